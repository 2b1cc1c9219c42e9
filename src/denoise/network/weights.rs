//! Weights of the network, from the container that Open Image Denoise publishes them in: little-endian, a table of tensors by
//! name at the end ("Tensor Archive", `.tza`, version 2; Open Image Denoise, `core/tza.cpp` and `training/tza.py`).

use half::f16;

/// Channels are stored in blocks of this size.
pub(super) const BLOCK: usize = 16;

/// Number of blocks of some channels.
pub(super) fn blocks(channels: usize) -> usize {
    channels.div_ceil(BLOCK)
}

/// A 3x3 convolution with a bias, followed by a rectifier.
pub(super) struct Convolution {
    /// Channels of each input, which are concatenated.
    pub inputs: Vec<usize>,
    /// Channels of the output.
    pub outputs: usize,
    /// For each block of outputs, block of inputs, row, column and input in the block: the weights of the block's outputs.
    pub weights: Vec<[f32; BLOCK]>,
    /// Biases, by block of outputs.
    pub bias: Vec<[f32; BLOCK]>,
}

/// A file of weights.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    tensors: Vec<Tensor<'a>>,
}

struct Tensor<'a> {
    name: &'a [u8],
    dimensions: Vec<usize>,
    offset: usize,
}

/// Reads numbers one after the other.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        taken
    }

    fn number(&mut self, bytes: usize) -> usize {
        self.take(bytes).iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte))
    }
}

impl<'a> Archive<'a> {
    /// An archive that the program contains.
    ///
    /// # Panics
    /// If it is not such an archive with half-precision tensors: a defect of the program.
    pub fn new(bytes: &'a [u8]) -> Archive<'a> {
        let mut header = Cursor { bytes, at: 0 };
        assert_eq!((header.number(2), header.number(1)), (0x41d7, 2), "a tensor archive of version 2");
        header.take(1);
        let mut table = Cursor { bytes, at: header.number(8) };
        let count = table.number(4);
        let tensors = (0..count).map(|_| {
            let length = table.number(2);
            let name = table.take(length);
            let rank = table.number(1);
            let dimensions = (0..rank).map(|_| table.number(4)).collect();
            table.take(rank);
            assert_eq!(table.take(1), b"h", "half precision");
            Tensor { name, dimensions, offset: table.number(8) }
        });
        Archive { bytes, tensors: tensors.collect() }
    }

    /// The shape and the values of a tensor.
    fn tensor(&self, name: &str) -> (&[usize], Vec<f32>) {
        let found = self.tensors.iter().find(|tensor| tensor.name == name.as_bytes());
        let tensor = found.expect("the network has the layer");
        let bytes = &self.bytes[tensor.offset..][..2 * tensor.dimensions.iter().product::<usize>()];
        let value = |two: &[u8]| f16::from_le_bytes([two[0], two[1]]).to_f32();
        (&tensor.dimensions, bytes.chunks_exact(2).map(value).collect())
    }

    /// A layer whose concatenated inputs have these numbers of channels.
    pub fn convolution(&self, name: &str, inputs: &[usize]) -> Convolution {
        let (shape, values) = self.tensor(&format!("{name}.weight"));
        let [outputs, total, 3, 3] = *shape else { panic!("{name}: a 3x3 convolution") };
        assert_eq!(total, inputs.iter().sum::<usize>(), "{name}: channels");
        let input_blocks: usize = inputs.iter().map(|&channels| blocks(channels)).sum();
        let mut weights = vec![[0.0; BLOCK]; blocks(outputs) * input_blocks * 9 * BLOCK];
        for output in 0..outputs {
            let (mut channel, mut block) = (0, output / BLOCK * input_blocks);
            for &count in inputs {
                for i in 0..count {
                    for k in 0..9 {
                        let at = ((block + i / BLOCK) * 9 + k) * BLOCK + i % BLOCK;
                        weights[at][output % BLOCK] = values[(output * total + channel + i) * 9 + k];
                    }
                }
                channel += count;
                block += blocks(count);
            }
        }
        let (_, values) = self.tensor(&format!("{name}.bias"));
        let mut bias = vec![[0.0; BLOCK]; blocks(outputs)];
        (0..outputs).for_each(|output| bias[output / BLOCK][output % BLOCK] = values[output]);
        Convolution { inputs: inputs.to_vec(), outputs, weights, bias }
    }
}
