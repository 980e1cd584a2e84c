#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// A part of a stage's state. The stage defines its content. A stage that changes the content must
// raise the version, and must refuse versions and names that it does not know (SectionReader does).
struct CheckpointSection {
  std::string name;
  int version = 1;
  std::string_view bytes;  // borrowed from the stage, or from Checkpoint::storage
};

// What a checkpoint belongs to.
struct CheckpointHeader {
  std::string stage;
  std::string identity;  // digest of the files and options of the training
  int64_t step = 0;      // number of steps done
};

// A checkpoint in memory. It can be moved, but not copied: the sections point into `storage`, whose
// memory stays where it is when the vector is moved.
struct Checkpoint {
  CheckpointHeader header;
  std::vector<CheckpointSection> sections;
  std::vector<char> storage;  // the whole file

  Checkpoint() = default;
  Checkpoint(Checkpoint&&) = default;
  Checkpoint& operator=(Checkpoint&&) = default;
};

// Writes a checkpoint as one file, atomically (atomic_file.h). Its format, little-endian:
//   char[8]   "PEPECKPT"
//   uint32    format, 1
//   uint32    size of the header, bytes
//   char[]    the header as JSON:
//             {"stage", "identity", "step", "sections": [{"name", "version", "size"}]}
//   char[]    the bytes of the sections, one after the other
//   char[64]  SHA-256 of all bytes before, lower-case hexadecimal
absl::Status WriteCheckpoint(const std::filesystem::path& path, const CheckpointHeader& header,
                             std::span<const CheckpointSection> sections);

// Reads a checkpoint and verifies its digest. NOT_FOUND: there is no such file. DATA_LOSS, naming
// the file: it is truncated, damaged or of another format.
absl::StatusOr<Checkpoint> ReadCheckpoint(const std::filesystem::path& path);

}  // namespace pepeseg
