//! `profiles.csv`: values along boundaries, with one row per facet node, output time and profile.

use super::{
    columns::PROFILES,
    contact_points::contact_points,
    csv::{CsvFile, Numbers, Time, entry},
    output_field::Converged,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Friction, PointState},
        space::{SurfacePoint, surface_points},
        state::State,
    },
    laws::contact::NodeContext,
    linear_algebra::tensor::{Mandel, add_scaled, apply, dot, norm},
    mesh::shape::facet_normal,
    parallel::{agreement::Agreed, exchange::exchange, session::Session},
};
use std::path::Path;

/// A boundary whose values are written.
#[derive(Debug)]
struct Profile<const D: usize> {
    /// The name of the boundary as an entry of the table.
    name: String,
    facets: Vec<u32>,
    points: Vec<SurfacePoint<D>>,
    /// The contacts of the body on this boundary, each on a part of it, on either of their sides.
    contacts: Vec<usize>,
}

/// The columns that only some contacts have.
#[derive(Debug, Clone, Copy)]
struct OptionalColumns {
    /// A law of the displacement acts on one of the profiles.
    gap: bool,
    friction: bool,
    /// Slip distances are kept.
    slip: bool,
}

/// Cosine of the angle up to which the normals of a profile and of a contact point are those of the same side of an edge: at the corner of
/// a cube that touches an obstacle it is 0.58.
const SAME_SIDE: f64 = 0.5;

/// The profiles of a job.
#[derive(Debug)]
pub struct Profiles<const D: usize> {
    profiles: Vec<Profile<D>>,
    with: OptionalColumns,
    /// The file, on rank 0.
    pub(crate) file: Option<CsvFile>,
}

impl<const D: usize> Profiles<D> {
    /// Prepares profiles along these boundaries, each with the contacts that act on it. Collective.
    pub fn new<const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        boundaries: &[(String, Vec<usize>)],
    ) -> Result<Self> {
        let prepare = |(name, contacts): &(String, Vec<usize>)| {
            let facets = body.mesh.boundary(name).map(|b| b.facets.clone()).unwrap_or_default();
            let points = surface_points(session, &body.mesh, &facets)?;
            // With the normals of the contact points.
            let whole = |point| if contacts.is_empty() { point } else { body.held.whole(point) };
            let points = points.into_iter().map(whole).collect();
            Ok(Profile { name: entry(name), facets, points, contacts: contacts.clone() })
        };
        let contacts = || boundaries.iter().flat_map(|(_, contacts)| contacts).map(|at| &body.contacts[*at]);
        let with = OptionalColumns {
            gap: contacts().any(|contact| contact.normal.law.depends_on_displacement()),
            friction: contacts().any(|contact| contact.friction.is_some()),
            slip: contacts().flat_map(|contact| &contact.friction).any(Friction::keeps_slip),
        };
        Ok(Self { profiles: boundaries.iter().map(prepare).collect::<Result<_>>()?, with, file: None })
    }

    /// Whether there are no profiles.
    pub(crate) fn is_empty(&self) -> bool {
        self.profiles.is_empty()
    }

    /// Opens the file on rank 0, if there are profiles; continues it after this time if one is given.
    pub fn open(&mut self, folder: &Path, goes_on_after: Option<f64>) -> Result<()> {
        if self.profiles.is_empty() {
            return Ok(());
        }
        let path = folder.join(PROFILES.file);
        let header = PROFILES.header(D, &[true, self.with.gap, self.with.friction, self.with.slip, true]);
        self.file = Some(CsvFile::open(&path, &header, goes_on_after)?);
        Ok(())
    }

    /// Writes the rows of the state, whose stress is given for each cell. Collective.
    pub fn write<const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        stress: &[Mandel<S>],
    ) -> Result<(), Agreed> {
        let at = Converged { session, body, state, stress };
        let states = session.agree(contact_points(at))?;
        let OptionalColumns { gap, friction, slip } = self.with;
        let width = 2 * D + 3 + usize::from(gap) + if friction { 2 * D } else { 0 } + usize::from(slip);
        for profile in &self.profiles {
            let rows = session.agree(profile.rows(at, &states, self.with))?;
            // All rows to rank 0.
            let mut counts = vec![0; session.ranks()];
            counts[0] = rows.len();
            let (rows, _) = exchange(session.world(), &rows, &counts)?;
            let written = self.file.as_mut().map_or(Ok(()), |file| {
                let mut rows: Vec<&[f64]> = rows.chunks_exact(width).collect();
                rows.sort_by(|a, b| compare(a, b));
                let gap_at = if self.with.gap { D + 3 } else { width };
                let mut row = |row: &[f64]| {
                    let (before, gap) = row.split_at(gap_at);
                    let (time, name, before) = (Time(state.time), &profile.name, Numbers(before));
                    match gap.split_first() {
                        None => file.row(format_args!("{time},{name},{before}")),
                        Some((gap, after)) if gap.is_nan() => {
                            file.row(format_args!("{time},{name},{before},,{}", Numbers(after)))
                        }
                        Some(_) => file.row(format_args!("{time},{name},{before},{}", Numbers(gap))),
                    }
                };
                rows.into_iter().try_for_each(&mut row)
            });
            session.agree(written)?;
        }
        Ok(())
    }

    /// Flushes all rows to the file.
    pub fn flush(&mut self) -> Result<()> {
        self.file.as_mut().map_or(Ok(()), CsvFile::flush)
    }
}

impl<const D: usize> Profile<D> {
    /// Position, normal displacement, normal velocity, contact pressure, if requested the gap, the friction traction `-sigma_tau` and
    /// the sliding velocity, the slip distance, and tangential displacement of each point on this rank.
    fn rows<const S: usize>(
        &self,
        Converged { body, state, stress, .. }: Converged<'_, D, S>,
        states: &[(usize, PointState<D>)],
        with: OptionalColumns,
    ) -> Result<Vec<f64>> {
        let by_stress =
            if self.contacts.is_empty() { self.pressure_of_stress(body, state, stress)? } else { vec![] };
        let (displacement, velocity) = (state.counted_displacement()?, state.velocity.local()?);
        let mut out = Vec::with_capacity(self.points.len() * (4 * D + 4));
        for (at, point) in self.points.iter().enumerate() {
            let node = point.node as usize;
            let along = |field: &[f64]| (0..D).map(|i| field[node * D + i] * point.normal[i]).sum::<f64>();
            let normal_velocity = along(&velocity);
            // At an edge there is a point for each direction of the facets around it.
            let first = states.partition_point(|(other, _)| *other < node);
            let here = states[first..].iter().take_while(|(other, _)| *other == node).map(|(_, state)| state);
            let along_normal = |state: &&PointState<D>| dot(&state.normal, &point.normal);
            let here = here
                .filter(|state| along_normal(state) > SAME_SIDE)
                .max_by(|a, b| along_normal(a).total_cmp(&along_normal(b)));
            let pressure = match self.contacts.first() {
                Some(&contact) if body.contacts[contact].normal.needs_ghosts => {
                    body.contacts[contact].normal.law.pressure(normal_velocity, NodeContext::default())
                }
                Some(_) => here.map_or(0.0, |state| state.pressure),
                None => by_stress[at],
            };
            out.extend(body.mesh.nodes[node]);
            let normal_displacement = along(&displacement);
            out.extend([normal_displacement, normal_velocity, pressure]);
            if with.gap {
                // Written as an empty entry.
                out.push(here.map_or(f64::NAN, |state| state.gap));
            }
            if with.friction {
                let rubbing = here.map_or([[0.0; D]; 2], |state| [state.friction, state.sliding]);
                out.extend(rubbing.concat());
            }
            if with.slip {
                out.push(here.map_or(0.0, |state| state.slip));
            }
            out.extend(add_scaled(&point.value(&displacement), -normal_displacement, &point.normal));
        }
        Ok(out)
    }

    /// `-sigma_nu` at each point: the mean over the facets around it, weighted by their measure. Collective.
    fn pressure_of_stress<const S: usize>(
        &self,
        body: &Body<D, S>,
        state: &State,
        stress: &[Mandel<S>],
    ) -> Result<Vec<f64>> {
        let mut sums = state.velocity.like()?;
        {
            let mut sums = sums.local_mut()?;
            sums.fill(0.0);
            let parts =
                self.facets.iter().flat_map(|&facet| body.mesh.sub_facets(facet).map(move |n| (facet, n)));
            for (facet, nodes) in parts {
                let normal = facet_normal(&nodes.map(|node| body.mesh.nodes[node as usize]));
                let measure = norm(&normal);
                let unit = normal.map(|x| x / measure);
                let sigma = &stress[body.mesh.facet_cells[facet as usize] as usize];
                let pressure = -dot(&apply(sigma, &unit), &unit);
                for node in nodes {
                    sums[node as usize * D] += pressure * measure;
                    sums[node as usize * D + 1] += measure;
                }
            }
        }
        sums.add_ghosts_to_owners()?;
        let sums = sums.owned()?;
        Ok(self.points.iter().map(|p| sums[p.node as usize * D] / sums[p.node as usize * D + 1]).collect())
    }
}

fn compare(a: &[f64], b: &[f64]) -> std::cmp::Ordering {
    let differs = a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
    differs.unwrap_or(std::cmp::Ordering::Equal)
}
