//! A field that runs write, as field files, restarts, the summary, the log, the report and studies use it, and the state it is
//! computed from.

use super::{
    declared::Declared,
    field::{Place, Shape, file_width},
};
use crate::{
    fem::{body::Body, state::State},
    job::Output,
    linear_algebra::tensor::Mandel,
    parallel::session::Session,
};
use std::ops::Deref;

/// A field that runs write.
#[derive(Debug, Clone, Copy)]
pub struct OutputField {
    /// Its name in field files: letters, digits and underscores. Also its key under `[output]` if the job has to ask for it.
    pub name: &'static str,
    /// Whether it has a value for each node or for each cell.
    pub place: Place,
    /// The shape of a value.
    pub shape: Shape,
    /// Its unit in the plane and in space.
    pub units: [&'static str; 2],
    /// What it is, in Markdown.
    pub meaning: &'static str,
    /// When it is written, in Markdown.
    pub written: &'static str,
    /// The condition under which a job requests it; absent: every run that has it writes it.
    pub is_asked_for: Option<fn(&Output) -> bool>,
    /// The report's picture of it.
    pub picture: Option<FieldPicture>,
    /// Numbers that summarise it at the end of a run.
    pub figures: Option<Figures>,
}

/// A picture of the body, coloured by a field: by the length of vectors.
#[derive(Debug, Clone, Copy)]
pub struct FieldPicture {
    /// Name of the picture.
    pub name: &'static str,
    /// What it shows, in words.
    pub quantity: &'static str,
    /// How values become colours.
    pub shading: Shading,
}

/// How values of a field become colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shading {
    /// Linear, from the smallest to the largest value.
    Linear,
    /// For errors: logarithmic, down to a hundredth of the largest; the caption states the root of the sum of their squares.
    Errors,
}

/// Numbers that summarise a field at the end of a run.
#[derive(Debug, Clone, Copy)]
pub struct Figures {
    /// What they are, in their order.
    pub members: &'static [Figure],
    /// The line of the log about them.
    pub line: fn(&[f64]) -> String,
}

/// A number that summarises a field.
#[derive(Debug, Clone, Copy)]
pub struct Figure {
    /// Its name in `summary.json`.
    pub name: &'static str,
    /// Its unit in the plane and in space.
    pub units: [&'static str; 2],
    /// What it is, in Markdown.
    pub meaning: &'static str,
    /// What the report calls it, if it shows it.
    pub words: Option<&'static str>,
}

impl OutputField {
    /// A field that every run writes, with the same unit in the plane and in space, no picture and no figures.
    pub(super) const fn plain(
        name: &'static str,
        place: Place,
        shape: Shape,
        unit: &'static str,
        meaning: &'static str,
    ) -> Self {
        let (is_asked_for, picture, figures) = (None, None, None);
        Self {
            name,
            place,
            shape,
            units: [unit; 2],
            meaning,
            written: "always",
            is_asked_for,
            picture,
            figures,
        }
    }

    /// The same, written under this condition.
    pub(super) const fn written(self, written: &'static str) -> Self {
        Self { written, ..self }
    }

    /// The same with a picture of this name, coloured linearly.
    pub(super) const fn with_picture(self, name: &'static str, quantity: &'static str) -> Self {
        Self { picture: Some(FieldPicture { name, quantity, shading: Shading::Linear }), ..self }
    }

    /// Numbers of a value in files.
    pub fn width(&self) -> usize {
        file_width(self.shape)
    }

    /// Its unit in this dimension.
    pub fn unit(&self, dimension: usize) -> &'static str {
        self.units[usize::from(dimension == 3)]
    }

    /// Its declaration, for those who read field files.
    pub fn declared(&self) -> Declared {
        let place = match self.place {
            Place::Node => "nodes",
            Place::Cell => "cells",
        };
        let field = Some([place, self.written]);
        Declared { units: self.units, field, ..Declared::new(vec![self.name.to_owned()], self.meaning) }
    }

    /// Whether a run with these keys writes it if it has it.
    pub fn is_wanted(&self, output: &Output) -> bool {
        self.is_asked_for.is_none_or(|is_asked_for| is_asked_for(output))
    }
}

/// A converged state, from which fields are computed.
#[derive(Clone, Copy)]
pub(crate) struct Converged<'a, const D: usize, const S: usize> {
    /// The ranks.
    pub session: &'a Session,
    /// The body.
    pub body: &'a Body<D, S>,
    /// Its state.
    pub state: &'a State,
    /// Its total stress in Pa, one a cell of this rank.
    pub stress: &'a [Mandel<S>],
}

/// A field of a state.
pub(crate) struct Computed<'a> {
    /// Values of the nodes or cells that this rank owns, in the order of the mesh.
    pub values: Box<dyn Deref<Target = [f64]> + 'a>,
    /// Its [`figures`](OutputField::figures), the same on all ranks; as many as they have names.
    pub figures: Vec<f64>,
}

impl<'a> Computed<'a> {
    /// A field without figures.
    pub(super) fn of(values: impl Deref<Target = [f64]> + 'a) -> Self {
        Self { values: Box::new(values), figures: Vec::new() }
    }
}
