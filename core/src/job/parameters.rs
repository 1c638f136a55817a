//! `[parameters]`: the values of numbers with names, and the expressions that contain them.

use std::collections::BTreeSet;

use super::report::Fault;
use super::schema::Kind;
use super::source::{Node, Value};
use crate::laws::expression::{Expression, Fault as ExpressionFault, Names, Resolved, Variable};

/// Largest number of parameters.
const MOST: usize = 1000;
/// Largest number of parameters that a message lists.
const LISTED: usize = 20;
/// Constants, whose names no parameter may have.
const RESERVED: [&str; 2] = ["inf", "pi"];
/// The largest number below which all whole numbers are exact.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// The parameters of a document.
#[derive(Debug, Default)]
pub(super) struct Parameters {
    /// Whether documents of this kind have parameters.
    is_available: bool,
    /// All names that parameters may have, in alphabetical order.
    listed: Vec<String>,
    /// The values; 1 for those with faults.
    names: Names,
    /// The names of those with faults.
    faulty: BTreeSet<String>,
    /// The names that expressions contain.
    used: BTreeSet<String>,
}

/// A parameter that an expression gives.
struct Formula<'a> {
    name: &'a str,
    text: &'a str,
    node: &'a Node,
}

impl Parameters {
    /// The parameters of a document whose file has this `text`.
    pub(super) fn read(kind: Kind, root: &Node, text: &str, faults: &mut Vec<Fault>) -> Self {
        let is_available = kind.root().property("parameters").is_some();
        let mut found = Self { is_available, ..Self::default() };
        let Some(node) = root.child("parameters").filter(|_| is_available) else { return found };
        let Value::Table(table) = &node.value else { return found };
        if table.len() > MOST {
            let message = format!("the job has {} parameters", table.len());
            faults
                .push(Fault::new(node.key.clone(), message, "").help(format!("at most {MOST} are allowed")));
        }
        let mut formulas = Vec::new();
        for (name, node) in table {
            if let Some([message, help]) = refusal(name) {
                faults.push(Fault::new(node.key.clone(), message, "").help(help));
                found.set_faulty(name);
                continue;
            }
            found.listed.push(name.clone());
            match &node.value {
                Value::Integer(number) => found.set(name, *number as f64),
                Value::Float(number) if number.is_finite() => found.set(name, *number),
                Value::Text(text) if table.len() <= MOST => formulas.push(Formula { name, text, node }),
                // The schema allows no others.
                _ => found.set_faulty(name),
            }
        }
        formulas.sort_by(|one, other| one.node.at.cmp(&other.node.at));
        found.compute(formulas, text, faults);
        found
    }

    /// Whether the document may have parameters.
    pub(super) fn is_available(&self) -> bool {
        self.is_available
    }

    /// Whether the document has no parameters.
    pub(super) fn are_none(&self) -> bool {
        self.listed.is_empty()
    }

    /// Compiles the expression of a number, in which parameters may occur; in time and place, too, so that its fault can name these.
    pub(super) fn resolve(&mut self, text: &str) -> Result<Resolved, ExpressionFault> {
        self.resolve_in(text, Variable::OF_TIME_AND_PLACE, "")
    }

    /// Compiles an expression in these variables in which parameters may occur; parameters hide variables that are not `allowed`, which
    /// is a list with commas.
    pub(super) fn resolve_in(
        &mut self,
        text: &str,
        variables: &[Variable],
        allowed: &str,
    ) -> Result<Resolved, ExpressionFault> {
        let is_seen = |variable: &&Variable| {
            let name = variable.name();
            !self.names.contains_key(name) || allowed.split(", ").any(|allowed| allowed == name)
        };
        let variables: Vec<Variable> = variables.iter().filter(is_seen).copied().collect();
        let resolved = Expression::resolve(text, &variables, &self.names)?;
        self.used.extend(resolved.names.iter().cloned());
        Ok(resolved)
    }

    /// The whole number that an expression of parameters gives.
    pub(super) fn whole(&mut self, text: &str) -> Option<i64> {
        let Resolved { expression, names } = self.resolve(text).ok()?;
        let is_number = expression.variable().is_none() && !self.have_fault(&names);
        is_number.then(|| whole(expression.evaluate(0.0, &[])))?
    }

    /// Whether one of these parameters could not be computed, which is a fault already.
    pub(super) fn have_fault(&self, names: &[String]) -> bool {
        names.iter().any(|name| self.faulty.contains(name))
    }

    /// Advice for an expression with this fault: the names of the parameters, if a name is unknown.
    pub(super) fn advice(&self, fault: &ExpressionFault) -> Option<String> {
        if !fault.is_unknown_name || !self.is_available {
            return None;
        }
        if self.are_none() {
            return Some("[parameters] can give a number a name".into());
        }
        let mut listed: Vec<&str> = self.listed.iter().map(String::as_str).take(LISTED).collect();
        listed.extend((self.listed.len() > LISTED).then_some("..."));
        Some(format!("parameters: {}", listed.join(", ")))
    }

    /// Warnings of parameters that no expression contains.
    pub(super) fn unused(&self) -> impl Iterator<Item = String> {
        let unused = self.names.keys().filter(|name| !self.used.contains(*name));
        unused.map(|name| format!("parameters.{name}: no key and no other parameter uses this parameter"))
    }

    fn set(&mut self, name: &str, value: f64) {
        self.names.insert(name.to_owned(), value);
    }

    fn set_faulty(&mut self, name: &str) {
        self.set(name, 1.0);
        self.faulty.insert(name.to_owned());
    }

    /// Computes those whose expressions contain computed ones only, until none is left.
    fn compute(&mut self, mut formulas: Vec<Formula<'_>>, text: &str, faults: &mut Vec<Fault>) {
        let mut waiting: BTreeSet<&str> = formulas.iter().map(|formula| formula.name).collect();
        loop {
            let before = formulas.len();
            formulas.retain(|formula| {
                let waits = words(formula.text).any(|word| waiting.contains(word));
                if !waits {
                    waiting.remove(formula.name);
                    match self.value(formula, text) {
                        Ok(Some(value)) => self.set(formula.name, value),
                        Ok(None) => self.set_faulty(formula.name),
                        Err(fault) => {
                            self.set_faulty(formula.name);
                            faults.push(fault);
                        }
                    }
                }
                waits
            });
            if formulas.len() == before {
                break;
            }
        }
        faults.extend(circle(&formulas));
        formulas.iter().for_each(|formula| self.set_faulty(formula.name));
    }

    /// The value of an expression of computed parameters; `None` if one of these has a fault.
    fn value(&mut self, formula: &Formula<'_>, text: &str) -> Result<Option<f64>, Fault> {
        let Formula { name, text: content, node } = formula;
        let Resolved { expression, names } = self.resolve(content).map_err(|fault| {
            let place = node.place_within(content, fault.at.clone(), text);
            let message = format!("in `parameters.{name}`: {}", fault.message);
            let refused = Fault::new(place, message, "").help(&fault.help);
            self.advice(&fault).iter().fold(refused, Fault::help)
        })?;
        if expression.variable().is_some() {
            let message = format!("`parameters.{name}` can't depend on t, x, y or z");
            let help = "a parameter is one number: use numbers and other parameters only";
            return Err(Fault::new(node.at.clone(), message, "").help(help));
        }
        let value = expression.evaluate(0.0, &[]);
        if !value.is_finite() && !self.have_fault(&names) {
            let message = format!("`parameters.{name}` is not a finite number");
            return Err(Fault::new(node.at.clone(), message, format!("this is {value}")));
        }
        Ok((!self.have_fault(&names)).then_some(value))
    }
}

/// The number as a whole number, if it is one.
pub(super) fn whole(number: f64) -> Option<i64> {
    (number.fract() == 0.0 && number.abs() < EXACT).then_some(number as i64)
}

/// Why a parameter cannot have this name, and the remedy.
fn refusal(name: &str) -> Option<[String; 2]> {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if name.is_empty() || name.starts_with(|c: char| c.is_ascii_digit()) || !name.chars().all(fits) {
        let message = format!("`{name}` is no name of a parameter");
        let help = "names are made of the letters a-z and A-Z, digits and _, and do not start with a digit";
        return Some([message, help.into()]);
    }
    if RESERVED.contains(&name) {
        let message = format!("`{name}` is a constant in expressions");
        return Some([message, "choose another name for the parameter".into()]);
    }
    None
}

/// The names in an expression, among other words.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
}

/// The fault of parameters of which each contains another.
fn circle(formulas: &[Formula<'_>]) -> Option<Fault> {
    let next = |from: &Formula<'_>| {
        words(from.text).find_map(|word| formulas.iter().find(|formula| formula.name == word))
    };
    let mut way = vec![formulas.first()?];
    let start = loop {
        let formula = next(way.last()?)?;
        if let Some(start) = way.iter().position(|before| before.name == formula.name) {
            break start;
        }
        way.push(formula);
    };
    let names: Vec<&str> = way[start..].iter().chain([&way[start]]).map(|formula| formula.name).collect();
    let message = format!("parameters contain each other in a circle: {}", names.join(" -> "));
    Some(Fault::new(way[start].node.at.clone(), message, "").help("give one of them a number"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::source::parse;

    /// The parameters of a job with this table, and the number of its faults.
    fn read(table: &str) -> (Parameters, usize) {
        let text = format!("[parameters]\n{table}");
        let mut faults = Vec::new();
        let root = parse(&text).expect("TOML");
        let parameters = Parameters::read(Kind::job(), &root, &text, &mut faults);
        (parameters, faults.len())
    }

    #[test]
    fn parameters_follow_from_each_other_in_any_order() {
        let (parameters, faults) = read("T = \"2*pi/W\"\nW = \"sqrt(k/m)\"\nk = 8\nm = 2.0\n_n1 = '-k^2'\n");
        assert_eq!(faults, 0);
        let values: Vec<f64> = ["T", "W", "k", "m", "_n1"].map(|name| parameters.names[name]).to_vec();
        assert_eq!(values, [std::f64::consts::PI, 2.0, 8.0, 2.0, -64.0]);
        assert_eq!(parameters.unused().count(), 2, "T and _n1");
    }

    #[test]
    fn expressions_contain_the_values_as_they_are() {
        let (mut parameters, _) = read("A = -0.1\nB = 1e-300\nn = 3\n");
        let resolved = parameters.resolve("A^2*t + min(B, x) - 2*n").expect("valid");
        assert_eq!(resolved.expression.text(), "(-0.1)^2*t + min((1e-300), x) - 2*(3.0)");
        assert_eq!(resolved.names, ["A", "B", "n"]);
        assert_eq!(resolved.expression.evaluate(2.0, &[1.0]), 0.1 * 0.1 * 2.0 + 1e-300 - 6.0);
        let again = Expression::parse(resolved.expression.text()).expect("an expression");
        assert_eq!(again.evaluate(2.0, &[1.0]), resolved.expression.evaluate(2.0, &[1.0]));
        assert_eq!(parameters.whole("2*n"), Some(6));
        assert_eq!(
            (parameters.whole("n/2"), parameters.whole("n*t"), parameters.whole("N")),
            (None, None, None)
        );
    }

    #[test]
    fn names_of_variables_and_functions_are_names_of_parameters_where_these_are_none() {
        let (mut parameters, faults) = read("d = 0.01\nx = '2*d'\ne = 3.0\nstep = 0.5\nt = 7\n");
        assert_eq!(faults, 0);
        let values: Vec<f64> = ["d", "x", "e", "step"].map(|name| parameters.names[name]).to_vec();
        assert_eq!(values, [0.01, 0.02, 3.0, 0.5]);
        let number = parameters.resolve("x*e + step*step(2)").expect("a number").expression;
        assert_eq!(number.evaluate(100.0, &[100.0]), 0.56);
        let place = parameters.resolve_in("2*d*y + t", Variable::OF_TIME_AND_PLACE, "y").expect("of place");
        assert_eq!(place.expression.evaluate(100.0, &[1.0, 2.0]), 7.04);
        for (text, variables, allowed) in [
            ("1 + d", &[Variable::V, Variable::D][..], "v, d"),
            ("t*y", Variable::OF_TIME_AND_PLACE, "t, x, y, z"),
        ] {
            let fault = parameters.resolve_in(text, variables, allowed).expect_err("two meanings");
            assert!(fault.message.contains("is a parameter, but here also the "), "{fault:?}");
            assert!(parameters.resolve_in("1 + step", variables, allowed).is_ok(), "no variable");
        }
    }

    #[test]
    fn what_gives_no_number_is_refused_once() {
        for (table, count) in [
            ("a = 'a'", 1),
            ("a = 'b'\nb = '2*c'\nc = 'a'\nf = 'a + 1'", 1),
            ("a = '1/0'\nb = '2*a'", 1),
            ("a = 'sqrt(-1)'", 1),
            ("a = '2*t'", 1),
            ("a = '2*B'", 1),
            ("a = '2*'", 1),
            ("a = ''", 1),
            ("pi = 1\ninf = 1\n1a = 1\na-b = 1\n\"\" = 1\n\"\u{e4}\" = 1", 6),
            // The schema refuses these.
            ("a = []\nb = inf\nc = true\nf = { g = 1 }", 0),
        ] {
            let (mut parameters, faults) = read(table);
            assert_eq!(faults, count, "{table}");
            let names: Vec<String> = parameters.names.keys().cloned().collect();
            names.iter().for_each(|name| assert_eq!(parameters.whole(name), None, "{name} in {table}"));
        }
        let many: String = (0..=MOST).map(|n| format!("a{n} = \"a{}\"\n", n + 1)).collect();
        assert_eq!(read(&many).1, 1);
    }
}
