#include "core/sfm/sfm_model.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "core/base/byte_reader.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

// COLMAP's binary files: a 64-bit count, then the records without padding, little-endian. COLMAP
// itself wrote them, so only their structure is checked here; core/formats/colmap.h checks values.
namespace pepeseg {
namespace {

constexpr int64_t kMaxFileBytes = int64_t{8} << 30;

absl::Status Malformed(const std::filesystem::path& path) {
  return absl::DataLossError(path.string() + ": is malformed");
}

absl::StatusOr<std::string> ReadBytes(const std::filesystem::path& path) {
  return ReadFile(path, path.string(), kMaxFileBytes);
}

// Position of a photograph's name in the bytes of images.bin.
struct NameSpan {
  size_t begin;
  size_t size;
};

// Finds the names of all photographs in the bytes of images.bin.
absl::StatusOr<std::vector<NameSpan>> FindNames(absl::string_view bytes,
                                                const std::filesystem::path& path) {
  constexpr uint64_t kPoseBytes = 4 + 7 * 8 + 4;  // id, rotation, translation, camera
  constexpr uint64_t kPointBytes = 24;            // x, y, id
  constexpr uint64_t kMaxPoints =
      uint64_t{1} << 40;  // more than any file holds; the product in bytes does not overflow
  ByteReader reader(bytes);
  const auto count = reader.Take<uint64_t>();
  std::vector<NameSpan> names;
  for (uint64_t i = 0; reader.ok() && i < count; ++i) {
    reader.Skip(kPoseBytes);
    const size_t begin = reader.offset();
    const size_t size = reader.TakeString().size();
    reader.Skip(std::min(reader.Take<uint64_t>(), kMaxPoints) * kPointBytes);
    // After the end the reader yields zeros, which must not become a name.
    if (reader.ok()) names.push_back({begin, size});
  }
  if (!reader.ok()) return Malformed(path);
  return names;
}

// Returns the mean reprojection error of points3D.bin in pixels, or 0 without points.
absl::StatusOr<double> MeanError(const std::filesystem::path& path) {
  constexpr uint64_t kMaxTrack = uint64_t{1} << 40;
  ASSIGN_OR_RETURN(const std::string bytes, ReadBytes(path));
  ByteReader reader(bytes);
  const auto count = reader.Take<uint64_t>();
  double sum = 0;
  for (uint64_t i = 0; reader.ok() && i < count; ++i) {
    reader.Skip(8 + 3 * 8 + 3);  // id, position, colour
    sum += reader.Take<double>();
    reader.Skip(std::min(reader.Take<uint64_t>(), kMaxTrack) * 8);
  }
  if (!reader.ok()) return Malformed(path);
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

}  // namespace

absl::StatusOr<SfmModel> ReadSfmModel(const std::filesystem::path& folder) {
  SfmModel model;
  model.folder = folder;
  const std::filesystem::path path = folder / "images.bin";
  ASSIGN_OR_RETURN(const std::string bytes, ReadBytes(path));
  ASSIGN_OR_RETURN(const std::vector<NameSpan> names, FindNames(bytes, path));
  model.names.reserve(names.size());
  for (const NameSpan& name : names) model.names.push_back(bytes.substr(name.begin, name.size));
  std::sort(model.names.begin(), model.names.end());
  ASSIGN_OR_RETURN(model.reprojection_error, MeanError(folder / "points3D.bin"));
  return model;
}

absl::StatusOr<std::vector<SfmModel>> ReadSfmModels(const std::filesystem::path& folder) {
  std::vector<SfmModel> models;
  std::error_code error;
  std::filesystem::directory_iterator entry(folder, error);
  // The mapper numbers the folders of its models: 0, 1, ...
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (!std::filesystem::exists(entry->path() / "images.bin", ignored)) continue;
    ASSIGN_OR_RETURN(SfmModel model, ReadSfmModel(entry->path()));
    models.push_back(std::move(model));
  }
  if (error) {
    return absl::InternalError(
        absl::StrCat("cannot list ", folder.string(), ": ", error.message()));
  }
  std::sort(models.begin(), models.end(), [](const SfmModel& a, const SfmModel& b) {
    // The largest model first; ties by the error, then by the folder, because the order of a
    // directory differs between file systems.
    if (a.names.size() != b.names.size()) return a.names.size() > b.names.size();
    if (a.reprojection_error != b.reprojection_error) {
      return a.reprojection_error < b.reprojection_error;
    }
    return a.folder < b.folder;
  });
  return models;
}

absl::Status CopyRenamed(const SfmModel& model, const std::map<std::string, std::string>& names,
                         const std::filesystem::path& folder) {
  for (const char* file : {"cameras.bin", "points3D.bin"}) {
    ASSIGN_OR_RETURN(const std::string bytes, ReadBytes(model.folder / file));
    RETURN_IF_ERROR(WriteFileAtomically(folder / file, bytes));
  }
  const std::filesystem::path path = model.folder / "images.bin";
  ASSIGN_OR_RETURN(const std::string bytes, ReadBytes(path));
  ASSIGN_OR_RETURN(const std::vector<NameSpan> spans, FindNames(bytes, path));
  // Copies everything between the names as it is: records have no lengths or offsets to adjust.
  std::string renamed;
  size_t copied = 0;
  for (const NameSpan& span : spans) {
    const auto name = names.find(bytes.substr(span.begin, span.size));
    // COLMAP knows only the names that LayOut gave it.
    if (name == names.end()) return Malformed(path);
    renamed.append(bytes, copied, span.begin - copied);
    renamed.append(name->second);
    copied = span.begin + span.size;
  }
  renamed.append(bytes, copied);
  return WriteFileAtomically(folder / "images.bin", renamed);
}

}  // namespace pepeseg
