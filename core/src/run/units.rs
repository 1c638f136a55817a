//! Sizes by which wrong units of a job are seen: of each body its extent, mass, waves and loads.

use super::{
    materials::{Materials, wave_speed},
    parts::area_of,
};
use crate::{
    error::Result,
    fem::body::Body,
    job::Job,
    laws::digits::Digits,
    linear_algebra::tensor::{larger, norm},
    parallel::{agreement::Agreed, session::Session},
};
use serde::Serialize;

/// Bodies that are measured.
const MOST: usize = 8;
/// Times of the run at which loads are evaluated.
const TIMES: u32 = 16;

/// No solid is stiffer: diamond has 1.2e12 Pa, which are 1.2e6 in the units mm, t, s. A larger Young's modulus is in Pa.
const STIFFEST_IN_MEGAPASCAL: f64 = 1.3e6;
/// No solid has faster waves in m/s: diamond has 18 km/s.
const FASTEST: f64 = 2e4;
/// Densities in kg/m^3 of steel and heavier metals. Rocks of the Earth's mantle have up to 5600, so that bodies of these are made by people.
const METALS: [f64; 2] = [6500.0, 23_000.0];
/// Young's modulus of lead in MPa is 1.6e4: no metal has a smaller number in the units mm, t, s.
const SOFTEST_IN_MEGAPASCAL: f64 = 1e4;
/// No machine or building of metal has a larger part, in m.
const LARGEST_PART: f64 = 1000.0;
/// Share of a body that a wave passes in a run, below which most of the body does not know of any load: with millimetres taken as metres
/// the share is too small by a factor of 1000.
const LEAST_PASSED: f64 = 0.01;
/// Coordinates of this multiple of the size of a body have few digits left for places in it: directions of its sides and rigid motions are
/// rounding errors.
const FARTHEST: f64 = 1e6;
/// Strain of loads in a body of this stiffness above which no solid holds together, and the equations of small strains are meaningless.
const LARGEST_STRAIN: f64 = 1.0;

/// A body as its units make it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct BodySize {
    /// Its size along each axis in m.
    pub extent: Vec<f64>,
    /// Its largest coordinate in m.
    pub farthest: f64,
    /// In `mass_unit`; 0 without density.
    pub mass: f64,
    /// kg, in the plane kg/m.
    pub mass_unit: &'static str,
    /// The largest density of its cells in kg/m^d; 0 without density.
    pub density: f64,
    /// The largest Young's modulus of its cells in Pa; 0 without elasticity.
    pub youngs_modulus: f64,
    /// The speed of its fastest compression waves in m/s; absent without density or elasticity.
    pub wave_speed: Option<f64>,
    /// Time in s in which such a wave passes the longest side of the body.
    pub wave_time: Option<f64>,
    /// Steps in this time, of the longest length.
    pub steps_per_wave: Option<f64>,
    /// Mean traction on loaded boundaries, and mean force per volume times the longest side, over Young's modulus: the largest of 17 times.
    pub load_strain: Option<f64>,
}

/// The first bodies of a run with this longest step in s, and the number of all. Collective.
pub(super) fn bodies<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
    step: f64,
) -> Result<(Vec<BodySize>, usize), Agreed> {
    let mesh = &body.mesh;
    let found = mesh.bodies(session)?;
    let materials = Materials::new(session, job, mesh)?;
    let mut sums = vec![Measured::<D>::default(); found.count.min(MOST)];
    let of_node = found.of_nodes(mesh);
    for (cell, shape) in body.geometry.cells().enumerate() {
        let number = found.of_cell[cell] as usize;
        let Some(sum) = sums.get_mut(number) else { continue };
        for node in mesh.cell_nodes(cell) {
            let place = &mesh.nodes[node as usize];
            for i in 0..D {
                sum.low[i] = sum.low[i].max(-place[i]);
                sum.high[i] = sum.high[i].max(place[i]);
            }
        }
        let material = &materials.all[materials.of_cell(mesh, cell)];
        let volume = shape.whole().volume;
        let density = material.density.unwrap_or(0.0);
        sum.volume += volume;
        sum.mass += volume * density;
        let modulus = material.elasticity.as_ref().map_or(0.0, |elasticity| elasticity.youngs_modulus);
        let speed = wave_speed(material, job.material.hypothesis);
        let most = [density, modulus, speed.unwrap_or(0.0)];
        sum.most = std::array::from_fn(|i| sum.most[i].max(most[i]));
    }
    for facet in body.load.tractions.iter().flat_map(|traction| &traction.facets) {
        let nodes = mesh.facets[*facet as usize];
        if let Some(sum) = of_node[nodes[0] as usize].and_then(|number| sums.get_mut(number as usize)) {
            sum.loaded_area += area_of(mesh, *facet);
        }
    }
    let loads = session.agree(loads(body, job.time.end, (&of_node, sums.len())))?;
    let mass_unit = if D == 2 && !mesh.is_revolved { "kg/m" } else { "kg" };
    let size = |(sum, loads): (&Measured<D>, _)| BodySize { mass_unit, ..sum.size(session, loads, step) };
    Ok((sums.iter().zip(loads).map(size).collect(), found.count))
}

/// Sums of the magnitudes of nodal forces in N on bodies at some times, on boundaries and inside, for the body of each node.
fn loads<const D: usize, const S: usize>(
    body: &Body<D, S>,
    end: f64,
    (of_node, count): (&[Option<u32>], usize),
) -> Result<Vec<Vec<[f64; 2]>>> {
    let mut sums = vec![vec![[0.0; 2]; TIMES as usize + 1]; count];
    let times = if body.load.is_steady() { 0 } else { TIMES };
    for at in 0..=times {
        let time = end * f64::from(at) / f64::from(TIMES);
        body.load.forces(&body.mesh, &body.geometry, time, |cell, node, force| {
            if let Some(sums) = of_node[node as usize].and_then(|number| sums.get_mut(number as usize)) {
                sums[at as usize][usize::from(cell.is_some())] += norm(force);
            }
        })?;
    }
    Ok(sums)
}

/// What cells and facets of this rank add to a body.
#[derive(Debug, Clone)]
struct Measured<const D: usize> {
    /// The smallest coordinates with the opposite sign.
    low: [f64; D],
    high: [f64; D],
    volume: f64,
    mass: f64,
    loaded_area: f64,
    /// The largest density, Young's modulus and speed of waves.
    most: [f64; 3],
}

impl<const D: usize> Default for Measured<D> {
    fn default() -> Self {
        let [low, high] = [[f64::NEG_INFINITY; D]; 2];
        Self { low, high, volume: 0.0, mass: 0.0, loaded_area: 0.0, most: [0.0; 3] }
    }
}

impl<const D: usize> Measured<D> {
    /// The size of the body. Collective.
    fn size(&self, session: &Session, loads: Vec<[f64; 2]>, step: f64) -> BodySize {
        let [low, high] = [self.low, self.high].map(|side| session.largest(side));
        let extent: Vec<f64> = (0..D).map(|i| low[i] + high[i]).collect();
        let longest = extent.iter().fold(0.0, |a: f64, b| a.max(*b));
        let [volume, mass, area] = session.sum([self.volume, self.mass, self.loaded_area]);
        let [density, youngs_modulus, speed] = session.largest(self.most);
        let mut stress: f64 = 0.0;
        for mine in loads {
            let [outside, inside] = session.sum(mine);
            let traction = if area > 0.0 { outside / area } else { 0.0 };
            stress = larger(stress, traction + inside / volume * longest);
        }
        let wave_speed = (speed > 0.0).then_some(speed);
        let wave_time = wave_speed.map(|speed| longest / speed);
        BodySize {
            extent,
            farthest: low.iter().chain(&high).fold(0.0, |most, x| larger(most, x.abs())),
            mass,
            mass_unit: "kg",
            density,
            youngs_modulus,
            wave_speed,
            wave_time,
            steps_per_wave: wave_time.map(|time| time / step),
            load_strain: (youngs_modulus > 0.0).then(|| stress / youngs_modulus),
        }
    }
}

impl BodySize {
    /// A line of `solver check`, where the name of the body is its number.
    pub(super) fn line(&self, number: usize) -> String {
        let sides: Vec<String> = self.extent.iter().map(|side| format!("{} m", Digits(*side))).collect();
        let mut text = format!("body {number:<6}{}", sides.join(" x "));
        if self.mass > 0.0 {
            text += &format!(", mass {} {}", Digits(self.mass), self.mass_unit);
        }
        if let (Some(speed), Some(time), Some(steps)) = (self.wave_speed, self.wave_time, self.steps_per_wave)
        {
            let [speed, time, steps] = [speed, time, steps].map(|number| Digits(rounded(number)));
            text += &format!("; compression waves of {speed} m/s pass it in {time} s, {steps} steps");
        }
        if let Some(strain) = self.load_strain.filter(|strain| *strain > 0.0) {
            text += &format!("; loads over stiffness {}", Digits(rounded(strain)));
        }
        text
    }

    /// Warnings about units, for a run that ends at this time in s.
    pub(super) fn warnings(&self, number: usize, end: f64) -> Vec<String> {
        let mut words = Vec::new();
        let mut warn = |what: String| words.push(format!("units: body {number} {what}"));
        let longest = self.extent.iter().fold(0.0, |a: f64, b| a.max(*b));
        let is_in_pascal = self.youngs_modulus > STIFFEST_IN_MEGAPASCAL;
        let is_metal = (METALS[0]..METALS[1]).contains(&self.density);
        // Along a bar: compression waves are as fast as can be where the material is nearly incompressible.
        let along_bar = self.wave_speed.map(|_| (self.youngs_modulus / self.density).sqrt());
        if let Some(speed) = along_bar.filter(|speed| is_in_pascal && *speed > FASTEST) {
            warn(format!(
                "has waves of {} m/s along a bar, but no solid has waves faster than {FASTEST} m/s: with Young's modulus in Pa the density \
                 is in kg/m^3, with the density in t/mm^3 Young's modulus is in MPa and lengths in mm",
                Digits(rounded(speed))
            ));
        } else if is_metal && !is_in_pascal && self.youngs_modulus > SOFTEST_IN_MEGAPASCAL {
            warn(format!(
                "has the density {} of a metal, but Young's modulus {} of rubber: with the density in kg/m^3 Young's modulus is in Pa, with \
                 Young's modulus in MPa the density is in t/mm^3",
                Digits(self.density),
                Digits(self.youngs_modulus)
            ));
        }
        if is_metal && is_in_pascal && longest > LARGEST_PART {
            warn(format!(
                "is {} m long and has the density of a metal: if the coordinates are in millimetres, give [mesh] scale = 0.001, or all other \
                 numbers in mm, t, s, N and MPa",
                Digits(longest)
            ));
        } else if let Some(time) = self.wave_time.filter(|time| end < LEAST_PASSED * time) {
            warn(format!(
                "needs {} s for a compression wave to pass it, but the run ends at {end} s: most of it will not know of any load; check the \
                 units of coordinates (millimetres taken as metres?), density and [time] end",
                Digits(rounded(time))
            ));
        }
        if self.farthest > FARTHEST * longest {
            warn(format!(
                "is {} m long, but its coordinates reach {} m: differences of such numbers have few digits, so that straight sides are bent \
                 and steps may fail; move it near the origin by [mesh] translate",
                Digits(rounded(longest)),
                Digits(rounded(self.farthest))
            ));
        }
        if let Some(strain) = self.load_strain.filter(|strain| *strain > LARGEST_STRAIN) {
            warn(format!(
                "has loads of {} times its stiffness, but the equations assume small strains: check the units of loads (N and Pa) and of \
                 Young's modulus (Pa)",
                Digits(rounded(strain))
            ));
        }
        words
    }
}

/// Three digits: sizes are no more accurate.
fn rounded(number: f64) -> f64 {
    format!("{number:.2e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bar of steel of 1 m in SI units, which is pulled by 100 MPa.
    fn bar() -> BodySize {
        BodySize {
            extent: vec![1.0, 0.1, 0.1],
            farthest: 1.0,
            mass: 78.5,
            mass_unit: "kg",
            density: 7850.0,
            youngs_modulus: 2.1e11,
            wave_speed: Some(5172.19),
            wave_time: Some(1.0 / 5172.19),
            steps_per_wave: Some(19.33),
            load_strain: Some(1e8 / 2.1e11),
        }
    }

    /// The same bar in mm, t, s, N and MPa.
    fn in_millimetres() -> BodySize {
        BodySize {
            extent: vec![1000.0, 100.0, 100.0],
            mass: 0.0785,
            density: 7.85e-9,
            youngs_modulus: 2.1e5,
            wave_speed: Some(5_172_190.0),
            load_strain: Some(100.0 / 2.1e5),
            ..bar()
        }
    }

    fn warns(size: &BodySize, words: &str) -> bool {
        let found = size.warnings(1, 0.001);
        found.len() == 1 && found[0].contains(words)
    }

    #[test]
    fn consistent_units_are_not_warned_of() {
        assert_eq!(bar().warnings(1, 0.001), Vec::<String>::new());
        assert_eq!(in_millimetres().warnings(1, 0.001), Vec::<String>::new());
        let rock = BodySize { extent: vec![1e5; 3], density: 2700.0, youngs_modulus: 5e10, ..bar() };
        assert_eq!(rock.warnings(1, 0.001), Vec::<String>::new(), "a block of the Earth");
        let rubber = BodySize { density: 1000.0, youngs_modulus: 1e7, wave_speed: Some(1.29e5), ..bar() };
        assert_eq!(rubber.warnings(1, 0.001), Vec::<String>::new(), "nearly incompressible");
    }

    #[test]
    fn mixed_units_are_warned_of() {
        let light = BodySize { density: 7.85e-9, wave_speed: Some(5.17e9), ..bar() };
        assert!(warns(&light, "no solid has waves faster than 20000 m/s"));
        let grams = BodySize { density: 7.85, wave_speed: Some(1.63e5), ..bar() };
        assert!(warns(&grams, "the density is in kg/m^3"));
        let heavy = BodySize { density: 7850.0, wave_speed: Some(5.17), ..in_millimetres() };
        assert!(warns(&heavy, "the density 7850 of a metal, but Young's modulus 210000 of rubber"));
        let long = BodySize { extent: vec![10_000.0, 100.0, 100.0], wave_time: Some(1.93), ..bar() };
        assert!(warns(&long, "is 10000 m long"));
        let short = BodySize { density: 2700.0, extent: vec![700.0; 3], wave_time: Some(0.14), ..bar() };
        assert!(warns(&short, "millimetres taken as metres?"));
        let far = BodySize { farthest: 4.5e6, ..bar() };
        assert!(warns(&far, "is 1 m long, but its coordinates reach 4.5e6 m"));
        let soft = BodySize { load_strain: Some(1.5), ..bar() };
        assert!(warns(&soft, "has loads of 1.5 times its stiffness"));
    }

    #[test]
    fn a_line_has_all_sizes_with_units() {
        assert_eq!(
            bar().line(1),
            "body 1     1 m x 0.1 m x 0.1 m, mass 78.5 kg; compression waves of 5170 m/s pass it in 0.000193 s, 19.3 steps; loads over stiffness 0.000476"
        );
        let still = BodySize {
            extent: vec![2.0, 1.0],
            mass: 0.0,
            wave_speed: None,
            wave_time: None,
            steps_per_wave: None,
            load_strain: None,
            ..bar()
        };
        assert_eq!(still.line(2), "body 2     2 m x 1 m");
    }
}
