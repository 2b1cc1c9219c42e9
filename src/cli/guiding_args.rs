//! Arguments about guiding.

use clap::Args;
use oscura::render::Guiding;

#[derive(Args, Clone, Debug)]
pub(crate) struct GuidingArgs {
    /// Guide paths at diffuse surfaces to where light came from, and end them where little is expected of them: on, off, or auto,
    /// where it makes indirect light less noisy. Learning takes a fifth of the work of the whole picture, also for a part of it; rooms
    /// lit through a door gain several times that.
    #[arg(long, value_name = "G", default_value = "auto")]
    pub guiding: Guiding,
}
