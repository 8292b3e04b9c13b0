//! The options of the command line.

use crate::choice::Choice;
use crate::palette::Colouring;
use crate::simulation::Setting;
use clap::Parser;
use pbig_scenes::scenes::Scene;
use std::path::PathBuf;

/// Objects fall in a window, with rapier's own broad phase or with pbig. Keys are shown in the window.
#[derive(Clone, Parser)]
#[command(version)]
pub struct Options {
    /// Which scene; a wrong name lists the right ones.
    #[arg(long, default_value = "column", value_parser = Scene::named)]
    pub scene: Scene,
    /// Number of objects.
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub bodies: u32,
    /// Seed of the scene's random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The broad phase to begin with.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Choice,
    /// The colours to begin with.
    #[arg(long, value_enum, default_value_t)]
    pub colour: Colouring,
    /// Width and height in pixels.
    #[arg(long, default_value = "1280x800", value_parser = parse_size)]
    pub size: [u32; 2],
    /// Folder for the pictures of the key P.
    #[arg(long, default_value = "out")]
    pub pictures: PathBuf,
    /// Write pictures (PNG) into this folder instead of opening a window. It needs no display.
    #[arg(long)]
    pub frames: Option<PathBuf>,
    /// Steps of 1/60 s (with --frames).
    #[arg(long, default_value_t = 300, requires = "frames")]
    pub steps: u32,
    /// Write every n-th step (with --frames).
    #[arg(long, default_value_t = 1, requires = "frames", value_parser = clap::value_parser!(u32).range(1..))]
    pub every: u32,
    /// Show stock at the left and pbig at the right, which make each step in turn (with --frames).
    #[arg(long, requires = "frames")]
    pub compare: bool,
}

impl Options {
    pub fn setting(&self) -> Setting {
        Setting { scene: self.scene, bodies: self.bodies as usize, seed: self.seed }
    }
}

/// Smallest width and height, in pixels: figures, graph and keys lie beside each other without overlap.
pub const MIN_SIZE: [u32; 2] = [720, 500];
/// Largest width and height, in pixels: the smallest limit that graphics adapters have.
const MAX_SIZE: u32 = 8192;

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once('x').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
    let size: [u32; 2] =
        parts.ok_or_else(|| format!("'{text}' is not a width and a height, such as 1280x800"))?;
    let fits = (0..2).all(|i| (MIN_SIZE[i]..=MAX_SIZE).contains(&size[i]));
    let [width, height] = MIN_SIZE;
    if fits { Ok(size) } else { Err(format!("sizes go from {width}x{height} to {MAX_SIZE}x{MAX_SIZE}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_and_bad_ones_are_errors() {
        assert_eq!(parse_size("720x500"), Ok(MIN_SIZE));
        for bad in ["800", "800x", "x600", "800x600x2", "-800x600", "0x0", "99999x600", "719x500", "720x499"]
        {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn steps_need_a_folder() {
        let parse = |options: &[&str]| Options::try_parse_from([&["viewer"], options].concat());
        let options = parse(&[]).unwrap();
        assert_eq!((options.scene.name, options.bodies, options.seed), ("column", 10_000, 1));
        assert!(parse(&["--frames", "x", "--steps", "3", "--compare"]).is_ok());
        assert!(parse(&["--steps", "3"]).is_err() && parse(&["--compare"]).is_err());
        assert!(parse(&["--scene", "nothing"]).is_err() && parse(&["--bodies", "0"]).is_err());
    }
}
