//! The seal at the start of a checkpoint or a partitioned mesh, which proves that all following bytes are unchanged.
//!
//! The seal is the first 512 bytes of the file (the user block, which HDF5 skips). It is checked by plain reads before HDF5 opens
//! the file, so that a damaged file is refused and never parsed:
//!
//! | bytes | content (numbers little endian) |
//! |---|---|
//! | 0..16 | what it is, such as `ClarkeCheckpoint` |
//! | 16..24 | format version |
//! | 24..32 | length of the whole file |
//! | 32..40 | digest of everything behind the seal |
//! | 40..504 | zero |
//! | 504..512 | XXH3 of bytes 0..504 |
//!
//! The digest is the sum modulo 2^64 over blocks of 1 MiB of the XXH3 of the block, seeded with its number. The blocks are
//! distributed over the ranks.

use super::redistribution::first_of_part;
use crate::error::{Error, Result, regular_file};
use crate::parallel::agreement::{Agreed, agree};
use mpi::collective::SystemOperation;
use mpi::traits::{Communicator, CommunicatorCollectives};
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// Number of bytes before the HDF5 content.
pub const SEAL_BYTES: u64 = 512;

/// The kind of a sealed file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// Its first bytes.
    pub magic: &'static [u8; 16],
    /// The version of its format that this program writes and reads.
    pub version: u64,
    /// Its name in messages.
    pub noun: &'static str,
    /// Advice for a damaged file.
    pub remedy: &'static str,
}

/// A checkpoint.
pub const CHECKPOINT: Kind = Kind {
    magic: b"ClarkeCheckpoint",
    version: 1,
    noun: "checkpoint",
    remedy: "Continue from another checkpoint with --restart FILE.h5, or start again without --restart",
};

const HDF5_SIGNATURE: &[u8; 8] = b"\x89HDF\r\n\x1a\n";
const BLOCK_BYTES: u64 = 1 << 20;

/// Seals a closed file whose first [`SEAL_BYTES`] are free, and synchronises it with the disk. Collective, with the same outcome on
/// all ranks.
pub fn seal(path: &Path, kind: Kind, communicator: &impl Communicator) -> Result<(), Agreed> {
    let length = std::fs::metadata(path).map(|status| status.len());
    let length = agree(communicator, length.map_err(|error| Error::unwritable(path, error)))?;
    let digest = shared_digest(path, length, communicator)?;
    let done = if communicator.rank() == 0 { stamp(path, kind, length, digest) } else { Ok(()) };
    agree(communicator, done.map_err(|error| Error::unwritable(path, error)))
}

/// Checks the seal and all bytes after it. Collective, with the same outcome on all ranks.
pub fn verify(path: &Path, kind: Kind, communicator: &impl Communicator) -> Result<(), Agreed> {
    let (length, expected) = agree(communicator, read_seal(path, kind))?;
    let found = shared_digest(path, length, communicator)?;
    agree(communicator, compare(path, kind, found, expected))
}

/// Checks the seal and all bytes after it, in this process only.
pub fn verify_alone(path: &Path, kind: Kind) -> Result<()> {
    let (length, expected) = read_seal(path, kind)?;
    let found = digest_part(path, length, 0, 1).map_err(|error| Error::unreadable(path, error))?;
    compare(path, kind, found, expected)
}

/// Whether the file starts with the seal of this kind.
pub fn is_sealed(path: &Path, kind: Kind) -> bool {
    starts_with(path, kind.magic)
}

/// Whether the file is an HDF5 file without a seal.
pub fn is_hdf5(path: &Path) -> bool {
    starts_with(path, HDF5_SIGNATURE)
}

fn starts_with<const N: usize>(path: &Path, bytes: &[u8; N]) -> bool {
    let mut start = [0; N];
    let opened = regular_file(path).and_then(|_| File::open(path));
    opened.and_then(|mut file| file.read_exact(&mut start)).is_ok() && start == *bytes
}

fn compare(path: &Path, kind: Kind, found: u64, expected: u64) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(refused(
        path,
        kind,
        format!("its content has the checksum {found:016x} instead of {expected:016x}: it is damaged"),
    ))
}

fn refused(path: &Path, kind: Kind, what: impl std::fmt::Display) -> Error {
    Error::Refused(format!("{}: {what}. {}", path.display(), kind.remedy))
}

fn stamp(path: &Path, kind: Kind, length: u64, digest: u64) -> io::Result<()> {
    let mut block = [0; SEAL_BYTES as usize];
    block[..16].copy_from_slice(kind.magic);
    block[16..24].copy_from_slice(&kind.version.to_le_bytes());
    block[24..32].copy_from_slice(&length.to_le_bytes());
    block[32..40].copy_from_slice(&digest.to_le_bytes());
    let own = xxh3_64(&block[..504]);
    block[504..].copy_from_slice(&own.to_le_bytes());
    let mut file = OpenOptions::new().write(true).open(path)?;
    file.write_all(&block)?;
    file.sync_all()
}

/// Length of the file and digest of the bytes after the seal, as the seal records them; nothing else is read.
pub(super) fn read_seal(path: &Path, kind: Kind) -> Result<(u64, u64)> {
    let unreadable = |error| Error::unreadable(path, error);
    let mut file = regular_file(path).and_then(|_| File::open(path)).map_err(unreadable)?;
    let found = file.metadata().map_err(unreadable)?.len();
    let mut block = [0; SEAL_BYTES as usize];
    if let Err(error) = file.read_exact(&mut block) {
        return Err(if error.kind() == io::ErrorKind::UnexpectedEof {
            refused(path, kind, format!("it has only {found} bytes: it is truncated or not a {}", kind.noun))
        } else {
            unreadable(error)
        });
    }
    let number =
        |from: usize| block[from..from + 8].iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
    if !block.starts_with(kind.magic) {
        let other = if block.starts_with(HDF5_SIGNATURE) { "an HDF5 file but " } else { "" };
        return Err(refused(path, kind, format!("it is {other}not a {}", kind.noun)));
    }
    if number(504) != xxh3_64(&block[..504]) {
        return Err(refused(path, kind, "its first 512 bytes are damaged"));
    }
    let version = number(16);
    if version != kind.version {
        let words =
            format!("it has {} format {version}, this program reads format {}", kind.noun, kind.version);
        return Err(refused(path, kind, words));
    }
    let length = number(24);
    if found != length {
        return Err(refused(path, kind, format!("it has {found} bytes instead of {length}: it is damaged")));
    }
    Ok((length, number(32)))
}

fn shared_digest(path: &Path, length: u64, communicator: &impl Communicator) -> Result<u64, Agreed> {
    let (part, parts) = (communicator.rank() as usize, communicator.size() as usize);
    let own = digest_part(path, length, part, parts).map_err(|error| Error::unreadable(path, error));
    let own = agree(communicator, own)?;
    let mut sum = 0_u64;
    communicator.all_reduce_into(&own, &mut sum, SystemOperation::sum());
    Ok(sum)
}

fn digest_part(path: &Path, length: u64, part: usize, parts: usize) -> io::Result<u64> {
    let content = length.saturating_sub(SEAL_BYTES);
    let blocks = content.div_ceil(BLOCK_BYTES);
    let mut file = File::open(path)?;
    let mut buffer = vec![0; BLOCK_BYTES.min(content) as usize];
    let first = first_of_part(blocks, part, parts);
    file.seek(SeekFrom::Start(SEAL_BYTES + first * BLOCK_BYTES))?;
    let mut sum = 0_u64;
    for block in first..first_of_part(blocks, part + 1, parts) {
        let size = BLOCK_BYTES.min(content - block * BLOCK_BYTES) as usize;
        file.read_exact(&mut buffer[..size])?;
        sum = sum.wrapping_add(xxh3_64_with_seed(&buffer[..size], block));
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sealed(folder: &Path) -> std::path::PathBuf {
        let path = folder.join("sealed");
        let content: Vec<u8> =
            (0..3_000_000_u32).map(|number| (number.wrapping_mul(number) >> 7) as u8).collect();
        std::fs::write(&path, &content).expect("write");
        let length = content.len() as u64;
        let digest = digest_part(&path, length, 0, 1).expect("digest");
        stamp(&path, CHECKPOINT, length, digest).expect("stamp");
        path
    }

    #[test]
    fn a_sealed_file_is_accepted_and_every_changed_byte_is_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let path = sealed(folder.path());
        verify_alone(&path, CHECKPOINT).expect("accepted");
        let good = std::fs::read(&path).expect("read");
        for position in [0, 17, 25, 33, 100, 505, 512, 70_000, 1_048_576 + 512, 2_999_999] {
            let mut bad = good.clone();
            bad[position] ^= 4;
            std::fs::write(&path, &bad).expect("write");
            let error = verify_alone(&path, CHECKPOINT).expect_err("refused").to_string();
            assert!(error.contains("sealed") && error.contains("--restart"), "{error}");
        }
    }

    #[test]
    fn a_file_of_another_format_version_names_both_versions() {
        let folder = tempfile::tempdir().expect("folder");
        let path = sealed(folder.path());
        let mut bytes = std::fs::read(&path).expect("read");
        bytes[16] = 9;
        let own = xxh3_64(&bytes[..504]);
        bytes[504..512].copy_from_slice(&own.to_le_bytes());
        std::fs::write(&path, &bytes).expect("write");
        let error = verify_alone(&path, CHECKPOINT).expect_err("refused").to_string();
        assert!(error.contains("format 9") && error.contains("format 1"), "{error}");
    }

    #[test]
    fn shares_of_the_digest_add_up_for_any_number_of_ranks() {
        let folder = tempfile::tempdir().expect("folder");
        let path = sealed(folder.path());
        let whole = digest_part(&path, 3_000_000, 0, 1).expect("digest");
        for parts in 2..6 {
            let sum = (0..parts).fold(0_u64, |sum, part| {
                sum.wrapping_add(digest_part(&path, 3_000_000, part, parts).expect("digest"))
            });
            assert_eq!(sum, whole);
        }
    }
}
