//! Gmsh files of the versions 2.2 and 4.0, and partitioned files.

use super::samples::{SQUARE, TENT};
use super::*;

/// The square of the samples in version 2.2.
const SQUARE_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 3 \"left\"\n2 5 \"plate\"\n$EndPhysicalNames\n\
    $Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n9 7 7 7\n$EndNodes\n\
    $Elements\n4\n1 1 2 3 1 1 4\n2 1 2 7 2 1 2\n3 2 2 5 1 1 2 3\n4 2 3 5 1 0 1 3 4\n$EndElements\n";

/// The same in version 4.0.
const SQUARE_4_0: &str = "$MeshFormat\n4 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 3 \"left\"\n2 5 \"plate\"\n$EndPhysicalNames\n\
    $Entities\n1 2 1 0\n5 0 0 0 0 0 0 0\n1 0 0 0 0 1 0 1 3 0\n2 0 0 0 1 0 0 1 7 2 1 -2\n1 0 0 0 1 1 0 1 5 2 1 2\n$EndEntities\n\
    $Nodes\n1 5\n1 2 0 5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n9 7 7 7\n$EndNodes\n\
    $Elements\n3 4\n1 1 1 1\n1 1 4\n2 1 1 1\n2 1 2\n1 2 2 2\n3 1 2 3\n4 1 3 4\n$EndElements\n";

/// Rewrites the sections of numbers of a text in binary: `kinds` has for each section the kinds of its numbers, `i`, `l`, `d` for int,
/// unsigned long and double, or `t` for a line of text.
fn binary(text: &str, kinds: &[(&str, &str)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        bytes.extend(line.as_bytes());
        bytes.push(b'\n');
        if line == "$MeshFormat" {
            bytes.extend(lines.next().expect("a version").replacen(" 0 ", " 1 ", 1).as_bytes());
            bytes.extend(b"\n\x01\0\0\0\n");
        }
        let Some((_, kinds)) = kinds.iter().find(|(section, _)| line.strip_prefix('$') == Some(section))
        else {
            continue;
        };
        let mut kinds = kinds.chars().filter(|kind| !kind.is_whitespace()).peekable();
        if kinds.next_if_eq(&'t').is_some() {
            bytes.extend(lines.next().expect("a count").as_bytes());
            bytes.push(b'\n');
        }
        let numbers =
            lines.by_ref().take_while(|line| !line.starts_with('$')).flat_map(str::split_whitespace);
        for number in numbers {
            match kinds.next().expect("a kind for each number") {
                'i' => bytes.extend(number.parse::<i32>().expect("an int").to_le_bytes()),
                'l' => bytes.extend(number.parse::<u64>().expect("a long").to_le_bytes()),
                _ => bytes.extend(number.parse::<f64>().expect("a double").to_le_bytes()),
            }
        }
        bytes.extend(format!("\n$End{}\n", line.trim_start_matches('$')).as_bytes());
    }
    bytes
}

fn square() -> AnyMesh {
    parse(SQUARE.text().as_bytes()).expect("a mesh")
}

#[test]
fn older_versions_give_the_same_mesh() {
    assert_eq!(parse(SQUARE_2.as_bytes()).expect("a mesh"), square());
    assert_eq!(parse(SQUARE_4_0.as_bytes()).expect("a mesh"), square());
}

#[test]
fn older_versions_in_binary_give_the_same_mesh() {
    let node = "iddd";
    // In binary the type, the number of elements and the number of tags come first.
    let elements =
        "$Elements\n4\n1 2 2\n1 3 1 1 4\n2 7 2 1 2\n2 2 2\n3 5 1 1 2 3\n4 5 1 1 3 4\n$EndElements\n";
    let (before, _) = SQUARE_2.split_once("$Elements").expect("elements");
    let all = [("Nodes", format!("t{}", node.repeat(5))), ("Elements", format!("t{}", "i".repeat(28)))];
    let kinds = all.each_ref().map(|(section, kinds)| (*section, kinds.as_str()));
    let file = binary(&format!("{before}{elements}"), &kinds);
    assert_eq!(parse(&file).expect("a mesh"), square());
    let all = [
        ("Entities", "llll iddddddl iddddddlil iddddddlilii iddddddlilii".to_owned()),
        ("Nodes", format!("ll iiil {}", node.repeat(5))),
        ("Elements", "ll iiil iii iiil iii iiil iiii iiii".to_owned()),
    ];
    let kinds = all.each_ref().map(|(section, kinds)| (*section, kinds.as_str()));
    assert_eq!(parse(&binary(SQUARE_4_0, &kinds)).expect("a mesh"), square());
}

#[test]
fn elements_of_one_entity_may_have_several_groups() {
    let text = SQUARE_2.replace("2 1 2 7 2 1 2", "2 1 2 3 1 1 2");
    let text = text
        .replace("$Elements\n4\n", "$Elements\n5\n")
        .replace("$EndElements", "5 1 2 8 1 1 2\n$EndElements");
    let AnyMesh::Two(mesh) = parse(text.as_bytes()).expect("a mesh") else { panic!("a mesh in space") };
    let named: Vec<_> =
        mesh.boundaries.iter().map(|boundary| (&*boundary.name, boundary.facets.len())).collect();
    assert_eq!(named, [("left", 2), ("8", 1)]);
}

#[test]
fn wrong_files_of_version_2_are_refused() {
    let refusal = |from: &str, to: &str| {
        let text = SQUARE_2.replace(from, to);
        assert_ne!(text, SQUARE_2);
        parse(text.as_bytes()).expect_err("refused").to_string()
    };
    assert!(refusal("$Nodes\n5", "$Nodes\n4000000000").contains("section $Nodes, line 10"));
    assert!(refusal("$Elements\n4", "$Elements\n3").contains("`4` where $EndElements is expected"));
    assert!(refusal("$Elements\n4", "$Elements\n5").contains("section $Elements"));
    assert!(refusal("4 2 3 5", "4 2 -3 5").contains("`-3` where the number of tags"));
    assert!(refusal("4 2 3 5 1 0 1 3 4", "4 2 3 0 1 0 1 3 4").contains("has cells but no physical group"));
    assert!(refusal("2.2 0 8", "2.2 0 4").contains("data size 4: 8 is expected"));
}

/// The two tetrahedra of the samples, one on each of two partitions.
fn partitioned() -> String {
    let elements = "3 3 1 3\n2 7 2 1\n1 1 2 3\n3 2 4 1\n2 1 2 3 4\n3 3 4 1\n3 2 5 3 4\n";
    TENT.text().replace(TENT.elements, elements).replace(
        "$EndEntities\n",
        "$EndEntities\n$PartitionedEntities\n2\n1\n9 1\n0 0 1 2\n7 2 1 1 1 0 0 0 1 1 0 1 3 0\n\
         2 3 1 1 1 0 0 0 1 1 1 0 0\n3 3 1 1 2 0 0 0 1 1 1 0 0\n$EndPartitionedEntities\n",
    )
}

#[test]
fn partitions_are_ignored() {
    assert_eq!(
        parse(partitioned().as_bytes()).expect("a mesh"),
        parse(TENT.text().as_bytes()).expect("a mesh")
    );
    // The partition has no groups of its own, but its parent.
    let inherited = partitioned().replace("1 3 0\n2 3 1", "0 0\n2 3 1");
    assert_eq!(parse(inherited.as_bytes()), parse(partitioned().as_bytes()));
}

#[test]
fn a_file_with_some_of_the_partitions_is_refused() {
    let one = partitioned().replace("3 3 1 3\n2 7", "2 2 1 3\n2 7").replace("3 3 4 1\n3 2 5 3 4\n", "");
    let words = parse(one.as_bytes()).expect_err("refused").to_string();
    assert!(words.contains("1 of the 2 partitions") && words.contains("PartitionSplitMeshFiles"), "{words}");
}
