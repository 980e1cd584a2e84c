#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/model_files/checkpoint.h"

// Converts between the state of a stage and the sections of its checkpoint. The stage has one
// function that visits each part of its state, for writing as well as for reading, so that the two
// cannot disagree:
//   template <class AnyState, class Visit>
//   void VisitSections(AnyState& state, const Visit& visit) { visit("name", version, state.part); }
// A part is a string, a vector of trivially copyable elements, or a trivially copyable value. Its
// bytes are those in memory.

namespace pepeseg {

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
inline absl::Status CheckSize(const char* name, size_t size, int64_t expected) {
  if (static_cast<int64_t>(size) == expected) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(name, " has ", size, " values, must have ", expected));
}

// Returns DATA_LOSS, naming the first such value, if a value is not finite.
inline absl::Status CheckFinite(const char* name, std::span<const float> values) {
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad == values.end()) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(name, "[", bad - values.begin(), "] is ", *bad, ": not finite"));
}

}  // namespace pepeseg
