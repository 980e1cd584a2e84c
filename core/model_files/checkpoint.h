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

// A part of a stage's state. What it holds and how is its owner's: who changes that raises the
// version, and who reads refuses a version, or a name, that it does not know.
struct CheckpointSection {
  std::string name;
  int version = 1;
  std::string_view bytes;  // of whoever made it
};

// What a checkpoint is of.
struct CheckpointHeader {
  std::string stage;
  std::string identity;  // digest of what the state belongs to: files and options
  int64_t step = 0;      // done
};

struct Checkpoint {
  CheckpointHeader header;
  std::vector<CheckpointSection> sections;  // into `storage`, which moves without moving them
  std::vector<char> storage;

  Checkpoint() = default;
  Checkpoint(Checkpoint&&) = default;
  Checkpoint& operator=(Checkpoint&&) = default;
};

// One file, whole or not at all (atomic_file.h), little-endian:
//   "PEPECKPT", u32 format (1), u32 bytes of the header, the header as JSON
//     {"stage", "identity", "step", "sections": [{"name", "version", "size"}]},
//   the sections' bytes one after the other, SHA-256 of all before as 64 hexadecimal digits.
absl::Status WriteCheckpoint(const std::filesystem::path& path, const CheckpointHeader& header,
                             std::span<const CheckpointSection> sections);

// NOT_FOUND: no such file. DATA_LOSS: truncated, damaged or of another format; the message names
// the file.
absl::StatusOr<Checkpoint> ReadCheckpoint(const std::filesystem::path& path);

}  // namespace pepeseg
