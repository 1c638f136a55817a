//! STL files of the surfaces of obstacles, which are read with the job.

use super::Job;
use crate::error::regular_file;
use crate::laws::contact::{Gap, Shape};
use std::path::Path;

/// Largest size of a file in bytes.
const LARGEST: u64 = 1 << 28;

impl Job {
    /// The obstacles with a shape, with the positions of their contacts.
    pub(super) fn shapes_mut(&mut self) -> impl Iterator<Item = (usize, &mut Shape)> {
        self.contact.iter_mut().enumerate().filter_map(|(number, contact)| match &mut contact.obstacle {
            Some(Gap::Shape(shape)) => Some((number, shape)),
            _ => None,
        })
    }
}

/// Reads the files of all surfaces. Each fault is a key of the job, a message and a remedy.
pub(super) fn read(job: &mut Job) -> Vec<[String; 3]> {
    let mut faults = Vec::new();
    for (number, shape) in job.shapes_mut() {
        let Some(file) = shape.surface.as_ref().map(|surface| surface.file.clone()) else { continue };
        let read = contents(&file).and_then(|bytes| {
            let help = "repair the surface, for example with `fill holes` and `union` of a mesh editor, and export it again";
            shape.read_surface(&bytes).map_err(|fault| [format!("{}: {fault}", file.display()), help.into()])
        });
        if let Err([message, help]) = read {
            faults.push([format!("contact.{number}.obstacle.shape.surface"), message, help]);
        }
    }
    faults
}

/// The bytes of a file; an error is a message and a remedy.
fn contents(path: &Path) -> Result<Vec<u8>, [String; 2]> {
    let place = path.display();
    let data = regular_file(path);
    if data.as_ref().is_ok_and(|data| data.len() > LARGEST) {
        return Err([format!("{place} has more than {LARGEST} bytes"), "use fewer triangles".into()]);
    }
    data.and_then(|_| std::fs::read(path)).map_err(|error| {
        let help = "a relative path starts from the folder of the job file";
        [format!("cannot read {place}: {error}"), help.into()]
    })
}
