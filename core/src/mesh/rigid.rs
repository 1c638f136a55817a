//! Rigid motions that the supports leave free.

use super::tags::place;
use crate::linear_algebra::tensor::{Vector, add_scaled, cross, dot, norm};

/// A rigid motion: translation, then rotation about x, y, z through the body's centre, lengths in units of its radius.
pub(super) type Motion = [f64; 6];

/// A unit constraint whose distance to the span of the others is below this counts as dependent on them.
const INDEPENDENT: f64 = 1e-9;

/// The constraints on the bodies of a mesh, and the points that bodies share.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Skeleton<const D: usize> {
    /// Coordinates in m.
    pub points: Vec<Vector<D>>,
    /// Components held at each point by an immovable body.
    pub held: Vec<[bool; D]>,
    /// The bodies, by number.
    pub bodies: Vec<RigidBody<D>>,
}

/// The constraints on the rigid motions of a body.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RigidBody<const D: usize> {
    /// Linear constraints on its motions.
    pub rows: Vec<Motion>,
    /// The points that it shares with other bodies.
    pub points: Vec<usize>,
    /// Centre of mass in m.
    pub centre: Vector<D>,
    /// Largest distance of its nodes from the centre, in m.
    pub radius: f64,
}

impl<const D: usize> Skeleton<D> {
    /// The free motions of each body that can move, in words.
    pub(super) fn free_motions(mut self) -> Vec<String> {
        let loose = self.loose();
        let words = |(number, free): (usize, Vec<Motion>)| {
            let body = &self.bodies[number];
            let motions = body.in_words(&free);
            format!("{}: {}", body.name(number), motions.join(", "))
        };
        loose.into_iter().map(words).collect()
    }

    /// The number of independent free motions of all bodies.
    pub(super) fn count_free_motions(mut self) -> usize {
        self.loose().iter().map(|(_, free)| free.len()).sum()
    }

    /// The numbers of the bodies that can move, each with a basis of its free motions.
    fn loose(&mut self) -> Vec<(usize, Vec<Motion>)> {
        let mut loose: Vec<usize> = (0..self.bodies.len()).collect();
        loop {
            let before = loose.len();
            loose.retain(|&number| {
                let body = &self.bodies[number];
                let free = !body.free(&self.points, &self.held).is_empty();
                if !free {
                    body.points.iter().for_each(|&point| self.held[point] = [true; D]);
                }
                free
            });
            if loose.len() == before {
                break;
            }
        }
        let free = |number: usize| (number, self.bodies[number].free(&self.points, &self.held));
        loose.into_iter().map(free).collect()
    }
}

impl<const D: usize> RigidBody<D> {
    /// An orthonormal basis of the free motions.
    fn free(&self, points: &[Vector<D>], held: &[[bool; D]]) -> Vec<Motion> {
        let rows = || {
            let joints = self.points.iter().flat_map(|&point| {
                let components = (0..D).filter(move |&component| held[point][component]);
                components.map(move |component| self.row(component, &points[point]))
            });
            self.rows.iter().copied().chain(joints)
        };
        let mut constrained = absent::<D>();
        extend(&mut constrained, rows);
        let held_count = constrained.len();
        extend(&mut constrained, || (0..6).map(unit));
        constrained.split_off(held_count)
    }

    /// The displacement component of a unit motion at a point.
    pub(super) fn row(&self, component: usize, point: &Vector<D>) -> Motion {
        let from_centre = add_scaled(point, -1.0, &self.centre);
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

    /// The displacement along a direction of a unit motion at a point.
    pub(super) fn row_along(&self, direction: &Vector<D>, point: &Vector<D>) -> Motion {
        let rows = direction.iter().enumerate();
        rows.fold([0.0; 6], |sum, (i, share)| add_scaled(&sum, *share, &self.row(i, point)))
    }

    /// Its number from 1 on, and where it is.
    pub(super) fn name(&self, number: usize) -> String {
        format!("body {} (around {})", number + 1, place(&self.centre))
    }

    /// A basis of free motions in words.
    pub(super) fn in_words(&self, free: &[Motion]) -> Vec<String> {
        const AXES: [&str; 3] = ["x", "y", "z"];
        // Supports hold components, so a free translation is one along the axes.
        let inside = |motion: &Motion| free.iter().map(|f| dot(f, motion).powi(2)).sum::<f64>() > 1.0 - 1e-8;
        let slides: Vec<usize> = (0..3).filter(|&axis| inside(&unit(axis))).collect();
        let mut words: Vec<String> =
            slides.iter().map(|&axis| format!("translation along {}", AXES[axis])).collect();
        let mut turns = free.to_vec();
        // Where contact holds one direction between the axes, another one is free.
        let oblique = |motion: &&Motion| slides.is_empty() && norm(&[motion[3], motion[4], motion[5]]) < 1e-8;
        words.extend(free.iter().filter(oblique).map(|motion| {
            let direction: Vector<D> = std::array::from_fn(|i| motion[i]);
            format!("translation along the direction {}", place(&direction))
        }));
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

/// In the plane, motion along z and rotations about x and y do not exist.
pub(super) fn absent<const D: usize>() -> Vec<Motion> {
    if D == 2 { [2, 3, 4].map(unit).to_vec() } else { Vec::new() }
}

pub(super) fn unit(axis: usize) -> Motion {
    std::array::from_fn(|i| (i == axis) as u8 as f64)
}

/// Extends an orthonormal basis by the span of rows, the most independent row first; gives the positions of the rows taken.
pub(super) fn extend<I: Iterator<Item = Motion>>(
    basis: &mut Vec<Motion>,
    rows: impl Fn() -> I,
) -> Vec<usize> {
    let mut taken = Vec::new();
    while basis.len() < 6 {
        let rest = |row: Motion| basis.iter().fold(row, |row, b| add_scaled(&row, -dot(&row, b), b));
        let candidates = rows().map(rest).enumerate();
        let Some((position, best)) = candidates.max_by(|a, b| norm(&a.1).total_cmp(&norm(&b.1))) else {
            break;
        };
        let length = norm(&best);
        if length <= INDEPENDENT {
            break;
        }
        // A second time, because rounding errors of a small remainder would impair orthogonality.
        let again = rest(best.map(|x| x / length));
        let length = norm(&again);
        basis.push(again.map(|x| x / length));
        taken.push(position);
    }
    taken
}

/// Combinations of the motions that rotate about one axis each where possible; translations are omitted.
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
    use crate::mesh::GlobalMesh;
    use crate::mesh::Tags;
    use crate::mesh::generate::{Diagonal, box_mesh, rectangle};
    use crate::mesh::surface::Topology;

    /// All nodes of a mesh as points, some of whose components are held.
    fn free<const D: usize>(mesh: &GlobalMesh<D>, held: impl Fn(Vector<D>) -> [bool; D]) -> Vec<String> {
        let topology = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &Tags::default()).unwrap();
        let bodies = topology.bodies();
        let body = |number: u32| {
            let cells = (0..mesh.cell_count()).filter(|&cell| bodies.of_cell[cell] == number);
            let mut points: Vec<usize> = cells.flat_map(|c| mesh.cell(c)).map(|&n| n as usize).collect();
            points.sort_unstable();
            points.dedup();
            let share = 1.0 / points.len() as f64;
            let centre = points.iter().fold([0.0; D], |sum, &p| add_scaled(&sum, share, &mesh.nodes[p]));
            let distance = |&p: &usize| norm(&add_scaled(&mesh.nodes[p], -1.0, &centre));
            let radius = points.iter().map(distance).fold(0.0, f64::max);
            RigidBody { rows: Vec::new(), points, centre, radius }
        };
        let skeleton = Skeleton {
            points: mesh.nodes.clone(),
            held: mesh.nodes.iter().map(|&point| held(point)).collect(),
            bodies: (0..bodies.count as u32).map(body).collect(),
        };
        skeleton.free_motions()
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
        // Rollers on three sides also suffice.
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
