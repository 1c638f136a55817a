//! A small file in sections, which can be combined without change or with one damaged section.

/// The sections of an ASCII file.
pub struct Sample {
    pub names: &'static str,
    pub entities: &'static str,
    pub nodes: &'static str,
    pub elements: &'static str,
}

/// A unit square of two triangles; the boundary `left`, and group 7 without a name; an orphan node 9.
pub const SQUARE: Sample = Sample {
    names: "2\n1 3 \"left\"\n2 5 \"plate\"\n",
    entities: "0 2 1 0\n1 0 0 0 0 1 0 1 3 0\n2 0 0 0 1 0 0 1 7 2 1 -2\n1 0 0 0 1 1 0 1 5 2 1 2\n",
    nodes: "1 5 1 9\n2 1 0 5\n1\n2\n3\n4\n9\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n7 7 7\n",
    elements: "3 4 1 4\n1 1 1 1\n1 1 4\n1 2 1 1\n2 1 2\n2 1 2 2\n3 1 2 3\n4 1 3 4\n",
};

/// Two tetrahedra over the triangle 1 2 3; the boundary `floor`.
pub const TENT: Sample = Sample {
    names: "1\n2 3 \"floor\"\n",
    entities: "0 0 1 1\n1 0 0 0 1 1 0 1 3 0\n1 0 0 0 1 1 1 0 0\n",
    nodes: "1 5 1 5\n3 1 0 5\n1\n2\n3\n4\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n",
    elements: "2 3 1 3\n2 1 2 1\n1 1 2 3\n3 1 4 2\n2 1 2 3 4\n3 2 5 3 4\n",
};

impl Sample {
    pub fn text(&self) -> String {
        format!(
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n{}$EndPhysicalNames\n$Entities\n{}$EndEntities\n\
             $Nodes\n{}$EndNodes\n$Elements\n{}$EndElements\n",
            self.names, self.entities, self.nodes, self.elements
        )
    }

    /// The same file in binary.
    pub fn binary(&self, big_endian: bool, wide_sizes: bool) -> Vec<u8> {
        let mut file = Writer { big_endian, wide_sizes, bytes: Vec::new() };
        file.line(&format!("$MeshFormat\n4.1 1 {}", if wide_sizes { 8 } else { 4 }));
        file.int(1);
        file.line("\n$EndMeshFormat\n$PhysicalNames");
        file.line(&format!("{}$EndPhysicalNames\n$Entities", self.names));
        let mut words = Words(self.entities.split_whitespace());
        let counts: Vec<u64> = (0..4).map(|_| file.size(&mut words)).collect();
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                file.ints(&mut words, 1);
                file.doubles(&mut words, if dimension == 0 { 3 } else { 6 });
                for _ in 0..if dimension == 0 { 1 } else { 2 } {
                    let tags = file.size(&mut words);
                    file.ints(&mut words, tags);
                }
            }
        }
        file.line("\n$EndEntities\n$Nodes");
        let mut words = Words(self.nodes.split_whitespace());
        let blocks = file.size(&mut words);
        file.sizes(&mut words, 3);
        for _ in 0..blocks {
            file.ints(&mut words, 3);
            let count = file.size(&mut words);
            file.sizes(&mut words, count);
            file.doubles(&mut words, 3 * count);
        }
        file.line("\n$EndNodes\n$Elements");
        let mut words = Words(self.elements.split_whitespace());
        let blocks = file.size(&mut words);
        file.sizes(&mut words, 3);
        for _ in 0..blocks {
            file.ints(&mut words, 2);
            let nodes = match file.ints(&mut words, 1) {
                15 => 1,
                1 => 2,
                2 => 3,
                _ => 4,
            };
            let count = file.size(&mut words);
            file.sizes(&mut words, count * (1 + nodes));
        }
        file.line("\n$EndElements");
        file.bytes
    }
}

struct Words<'a>(std::str::SplitWhitespace<'a>);

impl Words<'_> {
    fn next<T: std::str::FromStr<Err: std::fmt::Debug>>(&mut self) -> T {
        self.0.next().unwrap().parse().unwrap()
    }
}

struct Writer {
    big_endian: bool,
    wide_sizes: bool,
    bytes: Vec<u8>,
}

impl Writer {
    fn line(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
        self.bytes.push(b'\n');
    }

    fn int(&mut self, value: i32) {
        self.bytes.extend(if self.big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    }

    /// Writes ints and returns the last.
    fn ints(&mut self, words: &mut Words, count: u64) -> i32 {
        let mut last = 0;
        for _ in 0..count {
            last = words.next();
            self.int(last);
        }
        last
    }

    fn size(&mut self, words: &mut Words) -> u64 {
        let value: u64 = words.next();
        match (self.wide_sizes, self.big_endian) {
            (true, true) => self.bytes.extend(value.to_be_bytes()),
            (true, false) => self.bytes.extend(value.to_le_bytes()),
            (false, true) => self.bytes.extend((value as u32).to_be_bytes()),
            (false, false) => self.bytes.extend((value as u32).to_le_bytes()),
        }
        value
    }

    fn sizes(&mut self, words: &mut Words, count: u64) {
        for _ in 0..count {
            self.size(words);
        }
    }

    fn doubles(&mut self, words: &mut Words, count: u64) {
        for _ in 0..count {
            let value: f64 = words.next();
            self.bytes.extend(if self.big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
        }
    }
}
