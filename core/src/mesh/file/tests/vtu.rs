//! VTK files.

use super::*;
use crate::mesh::check;
use proptest::prelude::*;
use std::io::Write;

/// A unit square of a quadrilateral and two triangles with a line on the left; the regions 1 and -2, the boundary 7.
const SQUARE: &str = "\
<?xml version=\"1.0\"?>
<!-- made by hand -->
<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">
  <UnstructuredGrid>
    <Piece NumberOfPoints=\"6\" NumberOfCells=\"4\">
      <Points>
        <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">
          0 0 0  0.5 0 0  1 0 0  0 1 0  0.5 1 0  1 1 0
        </DataArray>
      </Points>
      <Cells>
        <DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 4 3 1 2 5 1 5 4 0 3</DataArray>
        <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4 7 10 12</DataArray>
        <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">9 5 5 3</DataArray>
      </Cells>
      <CellData Scalars=\"region\">
        <DataArray type=\"Int32\" Name=\"region\" format=\"ascii\">1 -2 -2 7</DataArray>
      </CellData>
    </Piece>
  </UnstructuredGrid>
</VTKFile>
";

const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn base64(bytes: &[u8]) -> String {
    let group = |chunk: &[u8]| {
        let bits = (0..3).fold(0_u32, |sum, i| sum << 8 | u32::from(*chunk.get(i).unwrap_or(&0)));
        let letter = |i: usize| {
            if i > chunk.len() { '=' } else { char::from(LETTERS[(bits >> (18 - 6 * i) & 63) as usize]) }
        };
        (0..4).map(letter).collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

/// The bytes of the numbers of an array.
fn encode(numbers: &str, kind: &str, is_big: bool) -> Vec<u8> {
    let words = numbers.split_whitespace();
    words
        .flat_map(|word| {
            let mut bytes = match kind {
                "Float64" => word.parse::<f64>().expect("a number").to_le_bytes().to_vec(),
                "Int64" => word.parse::<i64>().expect("a number").to_le_bytes().to_vec(),
                "Int32" => word.parse::<i32>().expect("a number").to_le_bytes().to_vec(),
                _ => vec![word.parse::<u8>().expect("a number")],
            };
            if is_big {
                bytes.reverse();
            }
            bytes
        })
        .collect()
}

/// How a file is written.
#[derive(Debug, Clone, Copy)]
struct Form {
    is_big: bool,
    is_wide: bool,
    is_packed: bool,
    /// `binary`, `base64` or `raw`, the last two at the end of the file.
    encoding: &'static str,
}

impl Form {
    fn number(self, number: usize) -> Vec<u8> {
        let mut bytes = number.to_le_bytes().to_vec();
        bytes.truncate(if self.is_wide { 8 } else { 4 });
        if self.is_big {
            bytes.reverse();
        }
        bytes
    }

    /// Header and data as parts that are encoded separately.
    fn parts(self, data: &[u8]) -> Vec<Vec<u8>> {
        if !self.is_packed {
            return vec![[self.number(data.len()), data.to_vec()].concat()];
        }
        let size = 32;
        let blocks: Vec<Vec<u8>> = data
            .chunks(size)
            .map(|block| {
                let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                packer.write_all(block).expect("packed");
                packer.finish().expect("packed")
            })
            .collect();
        let mut header =
            [self.number(blocks.len()), self.number(size), self.number(data.len() % size)].concat();
        blocks.iter().for_each(|block| header.extend(self.number(block.len())));
        vec![header, blocks.concat()]
    }

    fn file(self) -> Vec<u8> {
        let mut out = Vec::new();
        let mut appended: Vec<u8> = Vec::new();
        let order = if self.is_big { "BigEndian" } else { "LittleEndian" };
        let packer = if self.is_packed { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
        let header = if self.is_wide { "UInt64" } else { "UInt32" };
        let head = format!("byte_order=\"{order}\" header_type=\"{header}\"{packer}");
        let mut rest = SQUARE.replace("byte_order=\"LittleEndian\"", &head);
        while let Some(at) = rest.find("format=\"ascii\">") {
            let kind =
                rest[..at].rsplit("type=\"").next().expect("a type").split('"').next().expect("a type");
            let end = at + rest[at..].find("</DataArray>").expect("an end");
            let parts = self.parts(&encode(&rest[at + 15..end], kind, self.is_big));
            let text: String = parts.iter().map(|part| base64(part)).collect();
            out.extend(&rest.as_bytes()[..at]);
            if self.encoding == "binary" {
                out.extend(format!("format=\"binary\">\n  {text}\n").as_bytes());
            } else {
                out.extend(format!("format=\"appended\" offset=\"{}\">", appended.len()).as_bytes());
                let raw = if self.encoding == "raw" { parts.concat() } else { text.into_bytes() };
                appended.extend(raw);
            }
            rest = rest[end..].to_owned();
        }
        let (before, _) = rest.split_once("</VTKFile>").expect("an end");
        out.extend(before.as_bytes());
        if self.encoding != "binary" {
            out.extend(format!("<AppendedData encoding=\"{}\">\n _", self.encoding).as_bytes());
            out.extend(appended);
            out.extend(b"\n</AppendedData>\n");
        }
        out.extend(b"</VTKFile>\n");
        out
    }
}

fn forms() -> Vec<Form> {
    let mut forms = Vec::new();
    for encoding in ["binary", "base64", "raw"] {
        for bits in 0..8 {
            let [is_big, is_wide, is_packed] = [1, 2, 4].map(|bit| bits & bit > 0);
            forms.push(Form { is_big, is_wide, is_packed, encoding });
        }
    }
    forms
}

fn square() -> GlobalMesh<2> {
    match parse(SQUARE.as_bytes()).expect("a mesh") {
        AnyMesh::Two(mesh) => mesh,
        AnyMesh::Three(_) => panic!("a mesh in space"),
    }
}

#[test]
fn whole_numbers_of_cells_name_regions_and_boundaries() {
    let mesh = square();
    check::validate(&mesh, &Default::default()).expect("sound");
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (6, 4));
    assert_eq!(mesh.regions, ["-2", "1"]);
    for cell in 0..4 {
        assert_eq!(mesh.cell_regions[cell] == 1, mesh.centroid(cell)[0] < 0.5);
    }
    assert_eq!(mesh.boundaries.len(), 1);
    assert_eq!((&*mesh.boundaries[0].name, mesh.boundaries[0].facets.len()), ("7", 1));
    let other = SQUARE.replace("\"region\" format", "\"gmsh:physical\" format");
    assert_eq!(parse(other.as_bytes()), parse(SQUARE.as_bytes()));
}

#[test]
fn a_file_without_numbers_of_cells_is_one_region_and_says_so() {
    let text = SQUARE.replace("\"region\" format", "\"pressure\" format");
    let file = super::super::parse(text.as_bytes(), &Placement::default()).expect("a mesh");
    let AnyMesh::Two(mesh) = file.mesh else { panic!("a mesh in space") };
    assert_eq!(mesh.regions, ["body"]);
    assert!(file.notes[0].contains("all cells are the region body"), "{:?}", file.notes);
    assert_eq!(mesh.boundaries.iter().map(|b| &*b.name).collect::<Vec<_>>(), ["surface"]);
    assert_eq!(mesh.boundaries[0].facets.len(), mesh.facets.len());
    assert!(
        file.notes.iter().any(|note| note.contains("all of it is the boundary `surface`")),
        "{:?}",
        file.notes
    );
}

#[test]
fn every_encoding_gives_the_mesh_of_the_text() {
    for form in forms() {
        assert_eq!(
            parse(&form.file()).unwrap_or_else(|e| panic!("{form:?}: {e}")),
            AnyMesh::Two(square()),
            "{form:?}"
        );
    }
}

#[test]
fn voxels_have_the_order_of_the_axes() {
    let points = "0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1";
    let text = format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"8\" NumberOfCells=\"1\"><Points>\
         <DataArray type=\"Float32\" format=\"ascii\">{points}</DataArray></Points><Cells>\
         <DataArray type=\"Int64\" Name=\"connectivity\">0 1 2 3 4 5 6 7</DataArray>\
         <DataArray type=\"Int64\" Name=\"offsets\">8</DataArray><DataArray type=\"UInt8\" Name=\"types\">11</DataArray></Cells>\
         </Piece></UnstructuredGrid></VTKFile>"
    );
    let AnyMesh::Three(mesh) = parse(text.as_bytes()).expect("a mesh") else { panic!("a mesh of the plane") };
    let volume: f64 = (0..mesh.cell_count()).map(|cell| mesh.measure(cell)).sum();
    assert!((volume - 1.0).abs() < 1e-15 && mesh.cell_count() == 6);
}

#[test]
fn nodes_on_the_edges_of_tetrahedra_are_in_the_order_of_vtk() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
    let middle = |[a, b]: [usize; 2]| -> [f64; 3] {
        let [x, y, z] = crate::mesh::midpoint::<3>(&corners[a], &corners[b]);
        [x, y, z + 0.01]
    };
    let points: Vec<String> =
        corners.into_iter().chain(edges.map(middle)).flatten().map(|x| format!("{x:?}")).collect();
    let text = format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"10\" NumberOfCells=\"1\"><Points>\
         <DataArray type=\"Float64\" format=\"ascii\">{}</DataArray></Points><Cells>\
         <DataArray type=\"Int64\" Name=\"connectivity\">0 1 2 3 4 5 6 7 8 9</DataArray>\
         <DataArray type=\"Int64\" Name=\"offsets\">10</DataArray><DataArray type=\"UInt8\" Name=\"types\">24</DataArray></Cells>\
         </Piece></UnstructuredGrid></VTKFile>",
        points.join(" ")
    );
    let AnyMesh::Three(mesh) = parse(text.as_bytes()).expect("a mesh") else { panic!("a mesh of the plane") };
    assert_eq!(mesh.curved, edges.map(middle));
}

#[test]
fn wrong_files_are_refused() {
    #[track_caller]
    fn refused(text: &str, word: &str) {
        let error = parse(text.as_bytes()).expect_err("this file is wrong").to_string();
        assert!(error.contains(word), "`{word}` is missing in: {error}");
    }
    let changed = |from: &str, to: &str| {
        assert!(SQUARE.contains(from));
        SQUARE.replace(from, to)
    };
    refused("<html></html>", "no <Piece>");
    refused(&changed("UnstructuredGrid\" v", "PolyData\" v"), "line 3: a VTK file of type `PolyData`");
    refused(
        &changed("NumberOfCells=\"4\"", "NumberOfCells=\"5\""),
        "array `types`: it has 4 numbers, 5 are expected",
    );
    refused(
        &changed("NumberOfPoints=\"6\"", "NumberOfPoints=\"-6\""),
        "line 5: <Piece> needs NumberOfPoints",
    );
    refused(&changed("NumberOfPoints=\"6\"", "NumberOfPoints=\"9999999999999\""), "at most 2147483647");
    refused(&changed("0.5 0 0", "half 0 0"), "`half` where a number is expected");
    refused(&changed("9 5 5 3", "9 5 42 3"), "cell 2: type 42 is not read");
    refused(&changed("9 5 5 3", "9 5 9 3"), "cell 2: it has 3 nodes, type 9 has 4");
    refused(&changed("4 7 10 12", "4 3 10 12"), "cell 1: it ends at 3");
    refused(&changed("4 7 10 12", "4 7 10 13"), "cell 3: it ends at 13");
    refused(&changed("0 3</Data", "0 8</Data"), "has the node 8");
    refused(&changed("0 3</Data", "0 -3</Data"), "cell 3: it has the node -3");
    refused(
        &changed("byte_order", "compressor=\"vtkLZ4DataCompressor\" byte_order"),
        "zlib, uncompressed or in ASCII",
    );
    refused(&changed("</Piece>", "</Piece><Piece>"), "a second <Piece>");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_file_never_panics_and_never_gives_an_unsound_mesh(
        which in 0usize..25,
        length in any::<prop::sample::Index>(),
        is_cut in any::<bool>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..5), 0..5),
    ) {
        let mut file = forms().get(which).map_or_else(|| SQUARE.as_bytes().to_vec(), |form| form.file());
        if is_cut { file.truncate(length.index(file.len())); }
        damage_file(&mut file, damage, b"0123456789-. \n=/");
        assert_sound_or_refused(&file);
    }
}
