#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"

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

// Writes a checkpoint as one file, atomically (file_io.h). Its format, little-endian:
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
// Does the same with the bytes of a file, which errors call `name`.
absl::StatusOr<Checkpoint> ParseCheckpoint(std::vector<char> bytes,
                                           const std::filesystem::path& name);

// Converts between the state of a stage and the sections of its checkpoint. The stage has one
// function that visits each part of its state, for writing as well as for reading, so that the two
// cannot disagree:
//   template <class AnyState, class Visit>
//   void VisitSections(AnyState& state, const Visit& visit) { visit("name", version, state.part); }
// A part is a string, a vector of trivially copyable elements, or a trivially copyable value. Its
// bytes are those in memory.

// Returns the bytes of a part, which must outlive them.
template <class T>
std::string_view SectionBytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
inline std::string_view SectionBytes(const std::string& text) { return text; }
template <class T>
std::string_view SectionBytes(const T& value) {
  static_assert(std::is_trivially_copyable_v<T> && std::has_unique_object_representations_v<T>);
  return {reinterpret_cast<const char*>(&value), sizeof(T)};
}

// Sets a part from its bytes. Returns false if their number does not fit its type.
template <class T>
bool SetFromSection(std::string_view bytes, std::vector<T>& values) {
  if (bytes.size() % sizeof(T) != 0) return false;
  values.resize(bytes.size() / sizeof(T));
  if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return true;
}
inline bool SetFromSection(std::string_view bytes, std::string& text) {
  text = std::string(bytes);
  return true;
}
template <class T>
bool SetFromSection(std::string_view bytes, T& value) {
  if (bytes.size() != sizeof(T)) return false;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return true;
}

// The visitor for writing. Appends sections that borrow the bytes of the state.
struct SectionWriter {
  std::vector<CheckpointSection>& sections;

  template <class T>
  void operator()(const char* name, int version, const T& value) const {
    sections.push_back({name, version, SectionBytes(value)});
  }
};

// The visitor for reading. Call Finish after the last visit. Its state is mutable because visitors
// are passed as const references.
class SectionReader {
 public:
  explicit SectionReader(std::span<const CheckpointSection> sections) : sections_(sections) {}

  template <class T>
  void operator()(const char* name, int version, T& value) const {
    if (!status_.ok()) return;
    const auto found =
        std::find_if(sections_.begin(), sections_.end(),
                     [&](const CheckpointSection& section) { return section.name == name; });
    if (found == sections_.end()) {
      status_ = absl::DataLossError(absl::StrCat("section ", name, " is missing"));
    } else if (found->version != version) {
      status_ = absl::DataLossError(absl::StrCat("section ", name, " has version ", found->version,
                                                 ", this program reads ", version));
    } else if (!SetFromSection(found->bytes, value)) {
      status_ = absl::DataLossError(
          absl::StrCat("section ", name, " cannot have ", found->bytes.size(), " bytes"));
    }
    ++num_known_;
  }

  // Returns the first error. DATA_LOSS: a section is missing, unknown, of another version, or of a
  // size that does not fit.
  absl::Status Finish() const {
    if (!status_.ok() || num_known_ == sections_.size()) return status_;
    return absl::DataLossError(absl::StrCat("has ", sections_.size(), " sections, this program ",
                                            "knows ", num_known_, " of them"));
  }

 private:
  std::span<const CheckpointSection> sections_;
  mutable absl::Status status_;
  mutable size_t num_known_ = 0;
};

// Returns DATA_LOSS unless a section has the expected number of values.
absl::Status CheckSize(const char* name, size_t size, int64_t expected);

// Returns DATA_LOSS, naming the first such value, if a value is not finite.
absl::Status CheckFinite(const char* name, std::span<const float> values);

}  // namespace pepeseg
