//! The laws of the materials of a body.

/// A law for each material of the body; `None` for materials without it.
#[derive(Debug, Clone, PartialEq)]
pub struct ByMaterial<T>(Vec<Option<T>>);

impl<T> ByMaterial<T> {
    /// One entry per material; empty if no material has the law.
    pub fn new(laws: Vec<Option<T>>) -> Option<Self> {
        laws.iter().any(Option::is_some).then_some(Self(laws))
    }

    /// The law of a body of one material.
    pub fn uniform(law: T) -> Self {
        Self(vec![Some(law)])
    }

    /// The law of a material.
    #[inline(always)]
    pub fn get(&self, material: usize) -> Option<&T> {
        self.0[material].as_ref()
    }

    /// What follows from the law of each material, by its number; `None` without the law.
    pub fn filter_map<U>(&self, of: impl Fn(&T) -> Option<U>) -> Vec<Option<U>> {
        self.0.iter().map(|law| law.as_ref().and_then(&of)).collect()
    }

    /// Whether every material has the law.
    pub fn is_everywhere(&self) -> bool {
        self.0.iter().all(Option::is_some)
    }

    /// Another law for each material that has this one.
    pub fn map<U>(&self, law: impl Fn(&T) -> U) -> ByMaterial<U> {
        self.map_each(|_, own| law(own))
    }

    /// The same, given the material, too.
    pub fn map_each<U>(&self, law: impl Fn(usize, &T) -> U) -> ByMaterial<U> {
        let all = self.0.iter().enumerate();
        ByMaterial(all.map(|(material, own)| own.as_ref().map(|own| law(material, own))).collect())
    }

    /// All existing laws.
    pub fn laws(&self) -> impl Iterator<Item = &T> {
        self.0.iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::ByMaterial;

    #[test]
    fn a_law_that_no_material_has_does_not_exist() {
        assert_eq!(ByMaterial::<f64>::new(vec![None, None]), None);
        let some = ByMaterial::new(vec![None, Some(2.0)]).expect("a law");
        assert_eq!((some.get(0), some.get(1), some.is_everywhere()), (None, Some(&2.0), false));
        assert!(ByMaterial::uniform(1.0).is_everywhere());
    }
}
