//! STL files: triangles of a surface, in text or binary form.
//!
//! A binary file has 80 bytes of any content, the number of triangles, and 50 bytes for each. Programs write the word that begins a
//! text file into these 80 bytes, too, and the words of text files in lower or upper case.

use crate::linear_algebra::tensor::{Vector, larger};
use std::collections::HashMap;

/// Bytes before the first triangle of a binary file, and of each triangle.
const BINARY: [usize; 2] = [84, 50];
/// Corners that are nearer than this share of the largest coordinate are the same: numbers of binary files have seven digits, and
/// programs compute the corner of each triangle anew.
const SAME: f64 = 1e-6;
/// Side of the cells in which corners are searched, as a multiple of the distance of corners that are the same.
const CELL: f64 = 8.0;

/// Corners and triangles of corners.
pub(super) type Triangles = (Vec<Vector<3>>, Vec<[usize; 3]>);

/// The surface in a file with these bytes, with corners that almost coincide joined. An error says what is wrong with the file.
pub(super) fn read(bytes: &[u8]) -> Result<Triangles, String> {
    let is_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // A text file has no zero byte, a binary one at least two after each triangle.
    let corners = if is_text && !bytes.contains(&0) { text(bytes)? } else { binary(bytes)? };
    Ok(joined(&corners))
}

/// The corners of the triangles of a binary file, three for each.
fn binary(bytes: &[u8]) -> Result<Vec<Vector<3>>, String> {
    let [head, each] = BINARY;
    let count = bytes.get(head - 4..head).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    let Some(count) = count else {
        return Err(format!("it is not an STL file: it has {} bytes, the shortest has {head}", bytes.len()));
    };
    let triangles = &bytes[head..];
    if triangles.len() / each < count as usize {
        return Err(format!(
            "it is truncated, or not an STL file: {count} triangles are announced, and it has bytes for {}",
            triangles.len() / each
        ));
    }
    let number = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    // Of a triangle's bytes, the first twelve are its normal, and the last two have no meaning.
    let corners = triangles.chunks_exact(each).take(count as usize).flat_map(|triangle| {
        triangle[12..48].chunks_exact(12).map(|corner| [0, 4, 8].map(|at| number(&corner[at..at + 4])))
    });
    Ok(corners.collect())
}

/// The corners of the triangles of a text file, three for each.
fn text(bytes: &[u8]) -> Result<Vec<Vector<3>>, String> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_end();
    let mut corners = Vec::new();
    let mut is_open = false;
    let last = text.split('\n').count();
    for (number, line) in text.split('\n').enumerate().map(|(at, line)| (at + 1, line)) {
        let mut words = line.split_ascii_whitespace();
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                // The rest of the line is a name.
                "solid" => {
                    is_open = true;
                    break;
                }
                "endsolid" => {
                    is_open = false;
                    break;
                }
                "facet" | "outer" | "loop" | "endloop" => {}
                "normal" => {
                    words.by_ref().take(3).for_each(drop);
                }
                "vertex" => {
                    let mut corner = [0.0; 3];
                    for x in &mut corner {
                        let found = words.next().unwrap_or_default();
                        *x = match found.parse() {
                            Ok(value) => value,
                            Err(_) if number == last => return Err(truncated(number)),
                            Err(_) => {
                                return Err(format!(
                                    "in line {number}, a corner has \"{found}\" for a coordinate"
                                ));
                            }
                        };
                    }
                    corners.push(corner);
                }
                "endfacet" if corners.len().is_multiple_of(3) => {}
                "endfacet" => return Err(format!("in line {number}, a facet ends that is not a triangle")),
                _ if number == last => return Err(truncated(number)),
                _ => return Err(format!("it is not an STL file: line {number} has the word \"{word}\"")),
            }
        }
    }
    if is_open || !corners.len().is_multiple_of(3) {
        return Err(truncated(last));
    }
    Ok(corners)
}

fn truncated(line: usize) -> String {
    format!("it is truncated: it ends in line {line} without `endsolid`")
}

/// Triangles of corners, three of the given ones for each, of which those that almost coincide are one.
fn joined(given: &[Vector<3>]) -> Triangles {
    let size =
        given.as_flattened().iter().filter(|x| x.is_finite()).fold(0.0, |most, x| larger(most, x.abs()));
    let same = if size > 0.0 { SAME * size } else { 1.0 };
    let mut exact: HashMap<[u64; 3], usize> = HashMap::new();
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let mut corners: Vec<Vector<3>> = Vec::new();
    let mut number = |corner: &Vector<3>| {
        *exact.entry(corner.map(f64::to_bits)).or_insert_with(|| {
            let cell = |shift: f64| corner.map(|x| ((x + shift) / (CELL * same)).floor() as i64);
            let [low, high] = [cell(-same), cell(same)];
            let near = |&other: &usize| (0..3).all(|i| (corners[other][i] - corner[i]).abs() <= same);
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        if let Some(&found) =
                            cells.get(&[x, y, z]).and_then(|cell| cell.iter().find(|at| near(at)))
                        {
                            return found;
                        }
                    }
                }
            }
            cells.entry(cell(0.0)).or_default().push(corners.len());
            corners.push(*corner);
            corners.len() - 1
        })
    };
    let triangles =
        given.as_chunks::<3>().0.iter().map(|triangle| triangle.each_ref().map(&mut number)).collect();
    (corners, triangles)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A text file with these triangles, and a binary one.
    pub fn written(corners: &[Vector<3>], triangles: &[[usize; 3]]) -> [Vec<u8>; 2] {
        let mut text = String::from("solid a box\n");
        let mut binary = [b' '; 80].to_vec();
        binary[..5].copy_from_slice(b"solid");
        binary.extend((triangles.len() as u32).to_le_bytes());
        for triangle in triangles {
            text += "facet normal 0 0 0\nouter loop\n";
            binary.extend([0; 12]);
            for [x, y, z] in triangle.map(|corner| corners[corner]) {
                text += &format!("vertex {x} {y} {z}\n");
                binary.extend([x, y, z].map(|x| (x as f32).to_le_bytes()).as_flattened());
            }
            text += "endloop\nendfacet\n";
            binary.extend([0; 2]);
        }
        text += "endsolid a box\n";
        [text.into_bytes(), binary]
    }

    /// A tetrahedron.
    fn tetrahedron() -> Triangles {
        let corners = vec![[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]];
        (corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    fn places(file: &[u8]) -> Vec<[Vector<3>; 3]> {
        let (corners, triangles) = read(file).expect("a surface");
        triangles.into_iter().map(|triangle| triangle.map(|corner| corners[corner])).collect()
    }

    #[test]
    fn text_and_binary_files_in_any_spelling_have_the_same_triangles() {
        let (corners, triangles) = tetrahedron();
        let wanted: Vec<_> =
            triangles.iter().map(|triangle| triangle.map(|corner| corners[corner])).collect();
        let [text, binary] = written(&corners, &triangles);
        let upper = text.to_ascii_uppercase();
        let words = String::from_utf8(text.clone()).expect("text");
        let windows = words.replace('\n', "\r\n  ");
        let one_line = words.replace("loop\n", "loop ").replace("facet\n", "facet ");
        let twice = words.replace("endsolid a box", "endsolid\nsolid b") + "endsolid b";
        for file in [&text[..], &binary, &upper, windows.as_bytes(), one_line.as_bytes(), twice.as_bytes()] {
            assert_eq!(places(file), wanted, "{}", String::from_utf8_lossy(file));
        }
        let padded = [&binary[..], b"\0\0"].concat();
        assert_eq!(places(&padded), wanted);
    }

    #[test]
    fn corners_that_differ_by_rounding_are_one() {
        let (corners, triangles) = tetrahedron();
        let mut apart: Vec<Vector<3>> =
            triangles.iter().flat_map(|triangle| triangle.map(|corner| corners[corner])).collect();
        for (number, corner) in apart.iter_mut().enumerate() {
            let shift = 1e-17 * (number as f64 - 5.5) + if number % 2 == 0 { 4e-7 } else { 0.0 };
            corner.iter_mut().for_each(|x| *x -= shift);
        }
        let (found, same) = joined(&apart);
        assert_eq!((found.len(), same.len()), (4, 4));
        let (separate, _) = joined(&[[0.0; 3], [1e-5, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(separate.len(), 3, "far more than rounding");
        let (none, _) = joined(&[[0.0; 3], [0.0; 3], [-0.0; 3]]);
        assert_eq!(none.len(), 1);
        let (bad, _) = joined(&[[f64::NAN; 3], [f64::INFINITY; 3], [1.0; 3]]);
        assert_eq!(bad.len(), 3);
    }

    #[test]
    fn files_that_end_too_early_are_called_truncated() {
        let (corners, triangles) = tetrahedron();
        let [text, binary] = written(&corners, &triangles);
        for share in 1..20 {
            let [text, binary] = [&text, &binary].map(|file| &file[..file.len() * share / 20]);
            for file in [text, binary].into_iter().filter(|file| file.len() > 84) {
                let words = read(file).unwrap_err();
                assert!(words.contains("truncated"), "{share}: {words}");
            }
        }
        assert!(read(&text[..text.len() - 16]).unwrap_err().contains("truncated"), "without its last line");
        assert!(read(b"").unwrap_err().contains("0 bytes"));
        let words = String::from_utf8(text).expect("text");
        let bad = read(words.replacen("vertex 3", "vertex 3,5", 1).as_bytes()).unwrap_err();
        assert!(bad.contains("line 6") && bad.contains("\"3,5\""), "{bad}");
        let quad = words.replacen("endloop", "vertex 1 1 1\nendloop", 1);
        assert!(read(quad.as_bytes()).unwrap_err().contains("not a triangle"));
        assert!(read(b"solid x\n[mesh]\nfile = 1\n").unwrap_err().contains("\"[mesh]\""));
    }

    proptest! {
        #[test]
        fn damaged_files_are_refused_or_read(
            at in 0usize..700, byte in any::<u8>(), end in 0usize..700, is_text in any::<bool>(),
        ) {
            let (corners, triangles) = tetrahedron();
            let mut file = written(&corners, &triangles)[usize::from(!is_text)].clone();
            let at = at % file.len();
            file[at] = byte;
            file.truncate(1 + end % file.len());
            if let Ok((corners, triangles)) = read(&file) {
                prop_assert!(triangles.as_flattened().iter().all(|corner| *corner < corners.len()));
            }
        }
    }
}
