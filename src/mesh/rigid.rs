//! Rigid motions that the supports leave free.

use super::GlobalMesh;
use super::surface::Bodies;
use super::tags::place;
use crate::tensor::{Vector, add_scaled, dot, norm};

/// A rigid motion: translation, then rotation about x, y, z through the body's centre, lengths in units of its radius.
type Motion = [f64; 6];

/// A unit row that adds less than this to the span of the others adds nothing.
const INDEPENDENT: f64 = 1e-9;

/// The rigid motions each body can still do when `fixed` components of its nodes are held, in words: one text for
/// each body that can move, none when every body is held.
///
/// A node component fixed at `x` is one row on the motion `t + w × (x - c)`; what is orthogonal to all rows is free.
/// A body that touches a held body in single nodes is held there.
pub fn free_motions<const D: usize>(
    mesh: &GlobalMesh<D>,
    bodies: &Bodies,
    fixed: &dyn Fn(usize) -> [bool; D],
) -> Vec<String> {
    let mut held: Vec<[bool; D]> = (0..mesh.nodes.len()).map(fixed).collect();
    let mut loose: Vec<Body<D>> = collect(mesh, bodies);
    loop {
        let before = loose.len();
        loose.retain(|body| {
            let free = !body.free(mesh, &held).is_empty();
            if !free {
                body.nodes.iter().for_each(|&node| held[node as usize] = [true; D]);
            }
            free
        });
        if loose.len() == before {
            break;
        }
    }
    loose
        .iter()
        .map(|body| {
            let motions = body.in_words(&body.free(mesh, &held));
            format!("body {} (around {}): {}", body.number, place(&body.centre), motions.join(", "))
        })
        .collect()
}

struct Body<const D: usize> {
    number: usize,
    nodes: Vec<u32>,
    centre: Vector<D>,
    radius: f64,
}

fn collect<const D: usize>(mesh: &GlobalMesh<D>, bodies: &Bodies) -> Vec<Body<D>> {
    let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); bodies.count];
    let mut order: Vec<u32> = (0..mesh.cell_count() as u32).collect();
    order.sort_by_key(|&cell| bodies.of_cell[cell as usize]);
    let mut last_body = vec![u32::MAX; mesh.nodes.len()];
    for cell in order {
        let body = bodies.of_cell[cell as usize];
        for &node in mesh.cell(cell as usize) {
            if std::mem::replace(&mut last_body[node as usize], body) != body {
                nodes[body as usize].push(node);
            }
        }
    }
    let describe = |(number, nodes): (usize, Vec<u32>)| {
        let share = 1.0 / nodes.len() as f64;
        let place = |node: &u32| &mesh.nodes[*node as usize];
        let centre = nodes.iter().fold([0.0; D], |sum, node| add_scaled(&sum, share, place(node)));
        let distance = |node: &u32| norm(&add_scaled(place(node), -1.0, &centre));
        let radius = nodes.iter().map(distance).fold(f64::MIN_POSITIVE, f64::max);
        Body { number: number + 1, nodes, centre, radius }
    };
    nodes.into_iter().enumerate().map(describe).collect()
}

impl<const D: usize> Body<D> {
    /// An orthonormal basis of the free motions.
    fn free(&self, mesh: &GlobalMesh<D>, held: &[[bool; D]]) -> Vec<Motion> {
        let rows = || {
            self.nodes.iter().flat_map(|&node| {
                let from_centre = add_scaled(&mesh.nodes[node as usize], -1.0, &self.centre);
                let components = (0..D).filter(move |&component| held[node as usize][component]);
                components.map(move |component| self.row(component, &from_centre))
            })
        };
        // In the plane, motion along z and rotations about x and y do not exist.
        let mut constrained: Vec<Motion> = if D == 2 { [2, 3, 4].map(unit).to_vec() } else { Vec::new() };
        extend(&mut constrained, rows);
        let held_count = constrained.len();
        extend(&mut constrained, || (0..6).map(unit));
        constrained.split_off(held_count)
    }

    /// The displacement component of a unit motion at a point.
    fn row(&self, component: usize, from_centre: &Vector<D>) -> Motion {
        let mut at = [0.0; 3];
        for i in 0..D {
            at[i] = from_centre[i] / self.radius;
        }
        let (next, after) = ((component + 1) % 3, (component + 2) % 3);
        let mut row = unit(component);
        row[3 + next] = at[after];
        row[3 + after] = -at[next];
        row
    }

    fn in_words(&self, free: &[Motion]) -> Vec<String> {
        const AXES: [&str; 3] = ["x", "y", "z"];
        // Supports hold components, so a free translation is one along the axes.
        let inside = |motion: &Motion| free.iter().map(|f| dot(f, motion).powi(2)).sum::<f64>() > 1.0 - 1e-8;
        let slides: Vec<usize> = (0..3).filter(|&axis| inside(&unit(axis))).collect();
        let mut words: Vec<String> =
            slides.iter().map(|&axis| format!("translation along {}", AXES[axis])).collect();
        let mut turns = free.to_vec();
        turns.iter_mut().for_each(|turn| slides.iter().for_each(|&axis| turn[axis] = 0.0));
        for turn in reduced(turns) {
            let (slide, spin) = (
                [turn[0], turn[1], turn[2]],
                [turn[3], turn[4], turn[5]].map(|x| if x.abs() < 1e-6 { 0.0 } else { x }),
            );
            let turning: Vec<usize> = (0..3).filter(|&axis| spin[axis] != 0.0).collect();
            let axis = match turning[..] {
                [axis] => AXES[axis].to_string(),
                _ => format!("the direction {}", place(&spin)),
            };
            let pitch = dot(&slide, &spin) / dot(&spin, &spin);
            let kind = if pitch.abs() > 1e-6 { "screw motion" } else { "rotation" };
            let through = if slides.len() == D {
                String::new()
            } else {
                let lever = cross(&spin, &slide).map(|x| x / dot(&spin, &spin));
                let point: Vector<D> = std::array::from_fn(|i| {
                    let x = self.centre[i] + self.radius * lever[i];
                    if x.abs() < 1e-9 * self.radius { 0.0 } else { x }
                });
                format!(" through {}", place(&point))
            };
            words.push(format!("{kind} about {axis}{through}"));
        }
        words
    }
}

fn unit(axis: usize) -> Motion {
    std::array::from_fn(|i| (i == axis) as u8 as f64)
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Extends an orthonormal basis by the span of rows, the most independent row first.
fn extend<I: Iterator<Item = Motion>>(basis: &mut Vec<Motion>, rows: impl Fn() -> I) {
    while basis.len() < 6 {
        let rest = |row: Motion| basis.iter().fold(row, |row, b| add_scaled(&row, -dot(&row, b), b));
        let Some(best) = rows().map(rest).max_by(|a, b| norm(a).total_cmp(&norm(b))) else { return };
        let length = norm(&best);
        if length <= INDEPENDENT {
            return;
        }
        // Once more, so that rounding in a small rest does not spoil orthogonality.
        let again = rest(best.map(|x| x / length));
        let length = norm(&again);
        basis.push(again.map(|x| x / length));
    }
}

/// The motions combined so that each turns about one axis where that is possible; those that don't turn are left out.
fn reduced(mut motions: Vec<Motion>) -> Vec<Motion> {
    let mut done = 0;
    for axis in 3..6 {
        let Some(pivot) =
            (done..motions.len()).max_by(|&a, &b| motions[a][axis].abs().total_cmp(&motions[b][axis].abs()))
        else {
            break;
        };
        if motions[pivot][axis].abs() < 1e-7 {
            continue;
        }
        motions.swap(done, pivot);
        let scale = 1.0 / motions[done][axis];
        let row = motions[done].map(|x| x * scale);
        motions[done] = row;
        for (i, motion) in motions.iter_mut().enumerate() {
            if i != done {
                *motion = add_scaled(motion, -motion[axis], &row);
            }
        }
        done += 1;
    }
    motions.truncate(done);
    motions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Tags;
    use crate::mesh::generate::{Diagonal, box_mesh, rectangle};
    use crate::mesh::surface::Topology;

    fn free<const D: usize>(mesh: &GlobalMesh<D>, fixed: impl Fn(Vector<D>) -> [bool; D]) -> Vec<String> {
        let topology = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &Tags::default()).unwrap();
        free_motions(mesh, &topology.bodies(), &|node| fixed(mesh.nodes[node]))
    }

    fn plate() -> GlobalMesh<2> {
        rectangle([2.0, 1.0], [4, 2], Diagonal::Crossed, [1.0; 2]).unwrap()
    }

    fn block() -> GlobalMesh<3> {
        box_mesh([2.0, 1.0, 1.0], [2, 2, 2], [1.0; 3]).unwrap()
    }

    #[test]
    fn a_clamped_body_cannot_move() {
        assert!(free(&plate(), |p| [p[0] == 0.0; 2]).is_empty());
        assert!(free(&block(), |p| [p[2] == 0.0; 3]).is_empty());
        // Rollers on three sides hold as well.
        assert!(free(&block(), |p| p.map(|x| x == 0.0)).is_empty());
    }

    #[test]
    fn a_free_plate_has_three_motions_and_a_free_block_six() {
        let words = free(&plate(), |_| [false; 2]);
        assert_eq!(
            words,
            ["body 1 (around (1, 0.5)): translation along x, translation along y, rotation about z"]
        );
        let words = free(&block(), |_| [false; 3]);
        assert_eq!(words.len(), 1);
        assert!(words[0].ends_with(
            "translation along x, translation along y, translation along z, rotation about x, rotation about y, \
             rotation about z"
        ), "{}", words[0]);
    }

    #[test]
    fn rollers_leave_the_slide_along_them() {
        let words = free(&plate(), |p| [false, p[1] == 0.0]);
        assert_eq!(words, ["body 1 (around (1, 0.5)): translation along x"]);
        let words = free(&block(), |p| [false, false, p[2] == 0.0]);
        assert_eq!(words.len(), 1);
        assert!(
            words[0].contains("): translation along x, translation along y, rotation about z through ("),
            "{}",
            words[0]
        );
    }

    #[test]
    fn a_pinned_node_leaves_the_rotation_about_it() {
        let words = free(&plate(), |p| [p == [2.0, 0.0]; 2]);
        assert_eq!(words, ["body 1 (around (1, 0.5)): rotation about z through (2, 0)"]);
        let words = free(&block(), |p| [p == [0.0; 3]; 3]);
        assert_eq!(words[0].matches("rotation about").count(), 3);
        assert!(!words[0].contains("translation"), "{}", words[0]);
    }

    #[test]
    fn a_hinge_line_leaves_the_rotation_about_it() {
        let words = free(&block(), |p| [p[0] == 0.0 && p[2] == 0.0; 3]);
        assert_eq!(words, ["body 1 (around (1, 0.5, 0.5)): rotation about y through (0, 0.5, 0)"]);
        let skew = free(&block(), |p| [p == [0.0; 3] || p == [1.0, 1.0, 0.0]; 3]);
        assert!(skew[0].contains("rotation about the direction (1, 1, 0) through ("), "{}", skew[0]);
    }

    #[test]
    fn two_nodes_side_by_side_hold_a_plate_however_near_they_are() {
        let mesh = rectangle([1.0, 1.0], [1000, 1], Diagonal::Right, [2.0, 1.0]).unwrap();
        assert!(free(&mesh, |p| [p[1] == 0.0 && p[0] < 1.5e-6; 2]).is_empty());
    }

    /// A second plate to the right, sharing no facet; `joined` makes it share the first one's lower right node.
    fn two_plates(joined: bool) -> GlobalMesh<2> {
        let (mut mesh, other) = (plate(), plate());
        let shift = mesh.nodes.len() as u32;
        mesh.nodes.extend(other.nodes.iter().map(|p| [p[0] + if joined { 2.0 } else { 3.0 }, p[1] - 1.0]));
        let corner = mesh.nodes.iter().position(|&p| p == [2.0, 0.0]).unwrap() as u32;
        let twin =
            mesh.nodes[shift as usize..].iter().position(|&p| p == [2.0, 0.0]).map(|n| n as u32 + shift);
        let renumber = |&n: &u32| if Some(n + shift) == twin { corner } else { n + shift };
        mesh.cells.extend(other.cells.iter().map(renumber));
        mesh
    }

    #[test]
    fn only_the_body_without_support_is_named() {
        let words = free(&two_plates(false), |p| [p[0] == 0.0; 2]);
        assert_eq!(
            words,
            ["body 2 (around (4, -0.5)): translation along x, translation along y, rotation about z"]
        );
    }

    #[test]
    fn a_body_joined_to_a_held_one_in_a_single_node_turns_about_it() {
        let mesh = two_plates(true);
        let words = free(&mesh, |p| [p[0] == 0.0; 2]);
        assert_eq!(words.len(), 1);
        assert!(
            words[0].starts_with("body 2") && words[0].ends_with("): rotation about z through (2, 0)"),
            "{}",
            words[0]
        );
        assert!(free(&mesh, |p| [p[0] == 0.0, p == [4.0, 0.0] || p[0] == 0.0]).is_empty());
    }
}
