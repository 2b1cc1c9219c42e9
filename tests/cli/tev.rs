//! `--preview=tev`, against a listener that parses tev's protocol (its `Ipc.h`: a length that includes itself, the type as a
//! byte, zero-terminated strings, little-endian numbers).

use crate::program::*;
use std::collections::BTreeMap;
use std::io::Read;
use std::net::TcpListener;
use std::thread;

const CREATE: u8 = 4;
const UPDATE_BY_OFFSETS: u8 = 6;

/// The rest of a packet.
struct Packet(Vec<u8>);

impl Packet {
    fn read(stream: &mut impl Read) -> Option<Packet> {
        let mut length = [0; 4];
        stream.read_exact(&mut length).ok()?;
        let mut rest = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut rest).expect("as many bytes as are promised");
        Some(Packet(rest))
    }

    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let taken: Vec<u8> = self.0.drain(..N).collect();
        taken.try_into().expect("as many")
    }

    fn number(&mut self) -> usize {
        i32::from_le_bytes(self.bytes()) as usize
    }

    fn string(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).expect("an end");
        let text = self.0.drain(..=end).take(end).collect();
        String::from_utf8(text).expect("UTF-8")
    }
}

/// The pictures of a viewer: channels by name.
#[derive(Default)]
struct Viewer {
    name: String,
    size: [usize; 2],
    channels: BTreeMap<String, Vec<f32>>,
    updates: usize,
}

impl Viewer {
    fn take(&mut self, mut packet: Packet) {
        let ([kind], [_focus]) = (packet.bytes(), packet.bytes());
        let name = packet.string();
        match kind {
            CREATE => {
                self.size = [packet.number(), packet.number()];
                let [width, height] = self.size;
                let names: Vec<String> = (0..packet.number()).map(|_| packet.string()).collect();
                self.channels =
                    names.into_iter().map(|name| (name, vec![f32::NAN; width * height])).collect();
                self.name = name;
            }
            UPDATE_BY_OFFSETS => {
                assert_eq!(name, self.name);
                let names: Vec<String> = (0..packet.number()).map(|_| packet.string()).collect();
                let [x, y, width, height] = [(); 4].map(|()| packet.number());
                assert_eq!([x, y, width, height], [0, 0, self.size[0], self.size[1]]);
                let mut list = || names.iter().map(|_| u64::from_le_bytes(packet.bytes()) as usize).collect();
                let (offsets, strides): (Vec<usize>, Vec<usize>) = (list(), list());
                let (words, rest) = packet.0.as_chunks();
                let data: Vec<f32> = words.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
                assert!(rest.is_empty());
                for ((name, offset), stride) in names.iter().zip(offsets).zip(strides) {
                    let channel = self.channels.get_mut(name).expect("a channel of the picture");
                    (0..width * height).for_each(|i| channel[i] = data[offset + i * stride]);
                }
                self.updates += 1;
            }
            _ => panic!("a packet of kind {kind}"),
        }
    }
}

#[test]
fn tev_receives_the_finished_picture_with_passes() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let how = format!("--preview=tev:{}", listener.local_addr().expect("an address"));
    let viewer = thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a connection");
        let mut viewer = Viewer::default();
        while let Some(packet) = Packet::read(&mut stream) {
            viewer.take(packet);
        }
        viewer
    });
    render(folder.path(), "a.exr", &[&how, "--float", "--aov", "normal,object_id"]);
    let viewer = viewer.join().expect("packets as tev takes them");
    assert!(viewer.updates > 0);
    assert_eq!((&*viewer.name, viewer.size), ("cornell-box.gltf", [48, 48]));
    let planes = planes(&folder.path().join("a.exr"));
    assert!(planes.len() >= 8, "{:?}", planes.keys());
    for (name, values) in planes {
        assert_eq!(viewer.channels[&name], values, "{name}");
    }
}

#[test]
fn without_tev_nothing_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    // A port that was free a moment ago.
    let address = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port");
    let how = format!("--preview=tev:{address}");
    says(&run(folder.path(), &["render", &cornell(), "-o", "a.exr", &how], 2), "tev:HOST:PORT");
    assert!(names(folder.path()).is_empty());
    says(&run(folder.path(), &["render", &cornell(), "-o", "a.exr", "--preview=teV"], 2), "tev:HOST:PORT");
}

#[test]
fn closed_viewers_do_not_affect_the_render() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let how = format!("--preview=tev:{}", listener.local_addr().expect("an address"));
    let viewer = thread::spawn(move || drop(listener.accept()));
    // More than the socket buffers hold.
    let scene = cornell();
    let arguments = ["render", &scene, "-o", "a.exr", &how, "--width", "600", "--spp", "1"];
    let output = oscura(folder.path(), &arguments);
    viewer.join().expect("a connection");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stderr(&output).contains(&how["--preview=tev:".len()..]), "{}", stderr(&output));
    assert_eq!(names(folder.path()), ["a.exr"]);
}
