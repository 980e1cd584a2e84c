#include "core/reconstruct/reconstruct_checkpoint.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

// The one list of sections, for writing and for reading: name, version, value.
template <class AnyCheckpoint, class Visit>
void VisitSections(AnyCheckpoint& checkpoint, const Visit& visit) {
  visit("counters", 3, checkpoint.counters);
  visit("random", 1, checkpoint.random);
  visit("views_left", 1, checkpoint.views_left);
  visit("gaussians", 1, checkpoint.gaussians.shape);
  visit("parameters", 1, checkpoint.gaussians.parameters);
  visit("moment1", 1, checkpoint.gaussians.moment1);
  visit("moment2", 1, checkpoint.gaussians.moment2);
  visit("num_steps", 1, checkpoint.gaussians.num_steps);
  visit("grad_sum", 1, checkpoint.gaussians.grad_sum);
  visit("num_visible", 1, checkpoint.gaussians.num_visible);
  visit("refinable", 1, checkpoint.gaussians.refinable);
}

template <class T>
std::string_view BytesOf(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
std::string_view BytesOf(const std::string& text) { return text; }
template <class T>
std::string_view BytesOf(const T& value) {
  static_assert(std::is_trivially_copyable_v<T> && std::has_unique_object_representations_v<T>);
  return {reinterpret_cast<const char*>(&value), sizeof(T)};
}

// False: the size does not fit.
template <class T>
bool SetBytes(std::string_view bytes, std::vector<T>& values) {
  if (bytes.size() % sizeof(T) != 0) return false;
  values.resize(bytes.size() / sizeof(T));
  if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return true;
}
bool SetBytes(std::string_view bytes, std::string& text) {
  text = std::string(bytes);
  return true;
}
template <class T>
bool SetBytes(std::string_view bytes, T& value) {
  if (bytes.size() != sizeof(T)) return false;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return true;
}

const CheckpointSection* Find(std::span<const CheckpointSection> sections, std::string_view name) {
  const auto found =
      std::find_if(sections.begin(), sections.end(),
                   [&](const CheckpointSection& section) { return section.name == name; });
  return found == sections.end() ? nullptr : &*found;
}

absl::Status CheckSection(const CheckpointSection* section, const char* name, int version) {
  if (section == nullptr) return absl::DataLossError(absl::StrCat("section ", name, " is missing"));
  if (section->version == version) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("section ", name, " has version ", section->version,
                                          ", this program reads ", version));
}

absl::Status CheckSize(const char* name, size_t size, int64_t expected) {
  if (static_cast<int64_t>(size) == expected) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(name, " has ", size, " values, must have ", expected));
}

absl::Status CheckFinite(const char* name, std::span<const float> values) {
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad == values.end()) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(name, "[", bad - values.begin(), "] is ", *bad, ": not finite"));
}

absl::Status ValidateRows(const GaussianRows& rows) {
  const auto [count, sh_degree] = rows.shape;
  if (count < 1 || sh_degree < 0 || sh_degree > kMaxShDegree) {
    return absl::DataLossError(
        absl::StrCat("has ", count, " Gaussians of degree ", sh_degree, ": out of range"));
  }
  const int64_t num_planes = NumPlanes(static_cast<int>(sh_degree));
  RETURN_IF_ERROR(CheckSize("parameters", rows.parameters.size(), num_planes * count));
  RETURN_IF_ERROR(CheckSize("moment1", rows.moment1.size(), num_planes * count));
  RETURN_IF_ERROR(CheckSize("moment2", rows.moment2.size(), num_planes * count));
  RETURN_IF_ERROR(CheckSize("num_steps", rows.num_steps.size(), count));
  RETURN_IF_ERROR(CheckSize("grad_sum", rows.grad_sum.size(), count));
  RETURN_IF_ERROR(CheckSize("num_visible", rows.num_visible.size(), count));
  if (!rows.refinable.empty()) {
    RETURN_IF_ERROR(CheckSize("refinable", rows.refinable.size(), count));
  }
  RETURN_IF_ERROR(CheckFinite("parameters", rows.parameters));
  RETURN_IF_ERROR(CheckFinite("moment1", rows.moment1));
  RETURN_IF_ERROR(CheckFinite("moment2", rows.moment2));
  return CheckFinite("grad_sum", rows.grad_sum);
}

}  // namespace

std::vector<CheckpointSection> SectionsOf(const ReconstructCheckpoint& checkpoint) {
  std::vector<CheckpointSection> sections;
  VisitSections(checkpoint, [&](const char* name, int version, const auto& value) {
    sections.push_back({name, version, BytesOf(value)});
  });
  return sections;
}

absl::StatusOr<ReconstructCheckpoint> ReconstructCheckpointOf(
    std::span<const CheckpointSection> sections) {
  ReconstructCheckpoint checkpoint;
  absl::Status status;
  size_t num_known = 0;
  VisitSections(checkpoint, [&](const char* name, int version, auto& value) {
    if (!status.ok()) return;
    const CheckpointSection* section = Find(sections, name);
    status = CheckSection(section, name, version);
    if (!status.ok()) return;
    ++num_known;
    if (!SetBytes(section->bytes, value)) {
      status = absl::DataLossError(
          absl::StrCat("section ", name, " cannot have ", section->bytes.size(), " bytes"));
    }
  });
  RETURN_IF_ERROR(status);
  if (num_known != sections.size()) {
    return absl::DataLossError(absl::StrCat("has ", sections.size(), " sections, this program ",
                                            "knows ", num_known, " of them"));
  }
  RETURN_IF_ERROR(Validate(checkpoint));
  return checkpoint;
}

absl::Status Validate(const ReconstructCheckpoint& checkpoint) {
  if (checkpoint.counters.step < 0) {
    return absl::DataLossError(absl::StrCat("step ", checkpoint.counters.step, " is negative"));
  }
  return ValidateRows(checkpoint.gaussians);
}

}  // namespace pepeseg
