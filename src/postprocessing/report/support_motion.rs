//! The motions of supports that move as a whole along axes, from the job.

use crate::{
    io::output::quantity_name::source_names,
    job::{Fix, FixedDirections, Job, Scalar},
};

/// How a support moves along an axis.
pub(super) struct SupportMotion<'a> {
    /// Its name in resultants.csv.
    pub source: String,
    /// The name of its displacement along the axis, as of a column.
    pub column: &'static str,
    value: &'a Scalar,
    is_velocity: bool,
}

/// The motions of the supports of a job with a body of this dimension that change with time and not with place.
pub(super) fn support_motions(job: &Job, dimension: usize) -> Vec<SupportMotion<'_>> {
    let columns = ["support_displacement_x", "support_displacement_y", "support_displacement_z"];
    let mut all = Vec::new();
    for (support, source) in job.support.iter().zip(source_names(job)) {
        let axes: Vec<usize> = match &support.fix {
            Some(Fix::Keyword(FixedDirections::All)) => (0..dimension).collect(),
            Some(Fix::Axes(axes)) => axes.iter().map(|axis| axis.index()).collect(),
            Some(Fix::Keyword(FixedDirections::Normal)) | None => continue,
        };
        for (values, is_velocity) in [(&support.displacement, false), (&support.velocity, true)] {
            let moved = axes.iter().zip(values.iter().flatten());
            let as_whole = moved.filter(|(_, value)| {
                (value.depends_on_time() || is_velocity) && !value.depends_on_position()
            });
            all.extend(as_whole.map(|(&axis, value)| SupportMotion {
                source: source.clone(),
                column: columns[axis],
                value,
                is_velocity,
            }));
        }
    }
    all
}

impl SupportMotion<'_> {
    /// The displacement in m at these times in s, in ascending order: of a velocity its integral since t = 0, by Simpson's rule.
    pub(super) fn at(&self, times: &[f64]) -> Vec<f64> {
        let value = |time: f64| self.value.evaluate(time, &[0.0; 3]);
        let (mut before, mut way) = (0.0, 0.0);
        let mut moved = |time: f64| {
            if !self.is_velocity {
                return value(time);
            }
            way += (time - before) * (value(before) + 4.0 * value(0.5 * (before + time)) + value(time)) / 6.0;
            before = time;
            way
        };
        times.iter().map(|time| moved(*time)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn displacements_are_those_of_the_job_and_the_integrals_of_velocities() {
        let text = "mesh.rectangle = { size = [1, 1], cells = [1, 1] }\ntime = { end = 1.0, step = 0.1 }\n\
                    material = { hypothesis = 'plane_strain', elasticity = { youngs_modulus = 1, poisson_ratio = 0 } }\n\
                    [[support]]\non = ['left']\nfix = ['y', 'x']\ndisplacement = ['2*t', 'y*t']\n\
                    [[support]]\non = ['right']\nfix = 'all'\nvelocity = ['3*t^2', '1']\n\
                    [[support]]\non = ['top']\nfix = 'normal'\ndisplacement = ['t']\n";
        let job = Job::from_text(text, "job.toml", Path::new("."), &[]).unwrap_or_else(|e| panic!("{e}")).job;
        let found = support_motions(&job, 2);
        let names: Vec<[&str; 2]> = found.iter().map(|motion| [&*motion.source, motion.column]).collect();
        let [x, y] = ["support_displacement_x", "support_displacement_y"];
        assert_eq!(names, [["support left", y], ["support right", x], ["support right", y]], "not y*t");
        let times = [0.5, 2.0];
        assert_eq!(
            [0, 1, 2].map(|at| found[at].at(&times)),
            [[1.0, 4.0], [0.125, 8.0], [0.5, 2.0]].map(Vec::from)
        );
    }
}
