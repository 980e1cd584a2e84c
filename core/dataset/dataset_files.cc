#include "core/dataset/dataset_files.h"

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/file_name.h"

namespace pepeseg {
namespace {

bool IsUnder(absl::string_view name, absl::string_view folder) {
  return WithoutFolder(name, folder).size() < name.size();
}

// Returns true for COLMAP's cameras, images and points3D in sparse/N/ or sparse/.
bool IsColmapFile(absl::string_view name) {
  absl::string_view rest = WithoutFolder(name, "sparse");
  if (rest.size() == name.size()) return false;
  if (const size_t slash = rest.find('/'); slash != absl::string_view::npos) {
    const absl::string_view folder = rest.substr(0, slash);
    if (!std::ranges::all_of(folder, absl::ascii_isdigit)) return false;
    rest.remove_prefix(slash + 1);
  }
  const std::string suffix = Suffix(rest);
  const absl::string_view stem = WithoutSuffix(rest);
  return (suffix == ".bin" || suffix == ".txt") &&
         (stem == "cameras" || stem == "images" || stem == "points3D");
}

// Returns the kind of a file by its name, or nothing if it does not belong to a dataset. `in_depth`
// is the kind of the files in depth/.
std::optional<FileKind> KindOf(absl::string_view name, FileKind in_depth) {
  const std::string suffix = Suffix(name);
  const bool photo = suffix == ".jpg" || suffix == ".jpeg" || suffix == ".png" ||
                     suffix == ".webp" || suffix == ".heic" || suffix == ".heif";
  if (IsUnder(name, "images") && photo) return FileKind::kImage;
  if (IsColmapFile(name)) return FileKind::kPoses;
  if (name == "transforms.json" || name == "poses_bounds.npy") return FileKind::kPoses;
  const bool masks = suffix == ".json" || suffix == ".png" || suffix == ".npy";
  if (IsUnder(name, "masks") && masks) return FileKind::kMask;
  if (name == "ignore_mask.png") return FileKind::kIgnoreMask;
  if (IsUnder(name, "ignore") && suffix == ".png") return FileKind::kIgnoreMask;
  const bool map = suffix == ".png" || suffix == ".npy" || suffix == ".pfm";
  if (IsUnder(name, "depth") && map) return in_depth;
  if (IsUnder(name, "disparity") && map) return FileKind::kDisparity;
  // nerfstudio writes sparse_pc.ply.
  if (name == "points.ply" || name == "sparse_pc.ply") return FileKind::kPoints;
  if (name == "gaussians.ply") return FileKind::kGaussians;
  const bool video = suffix == ".mp4" || suffix == ".m4v" || suffix == ".mov" ||
                     suffix == ".webm" || suffix == ".mkv" || suffix == ".avi";
  if (IsUnder(name, "videos") && video) return FileKind::kVideo;
  return std::nullopt;
}

}  // namespace

absl::StatusOr<std::vector<DatasetFile>> ListDataset(const std::filesystem::path& folder,
                                                     DepthPrior::Kind depth_folder) {
  namespace fs = std::filesystem;
  const FileKind in_depth =
      depth_folder == DepthPrior::Kind::kDepth ? FileKind::kDepth : FileKind::kDisparity;
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return absl::NotFoundError(absl::StrCat(folder.string(), " is not a folder"));
  }
  std::vector<DatasetFile> files;
  bool any_picture = false;
  fs::recursive_directory_iterator entry(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    // An entry that cannot be examined, such as a dangling link, is skipped.
    std::error_code unreadable;
    if (!entry->is_regular_file(unreadable)) continue;
    std::string name = entry->path().lexically_relative(folder).generic_string();
    if (IsSystemFile(name)) continue;
    const std::optional<FileKind> kind = KindOf(name, in_depth);
    if (!kind) continue;
    any_picture = any_picture || *kind == FileKind::kImage || *kind == FileKind::kVideo;
    files.push_back({*kind, std::move(name), entry->path()});
  }
  if (error) {
    return absl::InternalError(
        absl::StrCat("cannot list ", folder.string(), ": ", error.message()));
  }
  if (!any_picture) {
    return absl::InvalidArgumentError(
        absl::StrCat(folder.string(),
                     " has no photographs: no JPEG, PNG, WebP or HEIC below images/, no video "
                     "below videos/"));
  }
  // Sorted, because the order of a directory differs between file systems.
  std::sort(files.begin(), files.end(),
            [](const DatasetFile& a, const DatasetFile& b) { return a.name < b.name; });
  return files;
}

std::string PhotoKey(absl::string_view name) { return std::string(WithoutFolder(name, "images")); }

bool IsFrameOf(absl::string_view video, absl::string_view photograph) {
  const absl::string_view name = WithoutFolder(WithoutFolder(video, "videos"), "images");
  return absl::StartsWith(photograph, absl::StrCat(WithoutSuffix(name), "_"));
}

std::string FirstNames(std::span<const std::string> names) {
  constexpr size_t kNamed = 5;
  const std::string first = absl::StrJoin(names.first(std::min(names.size(), kNamed)), ", ");
  return names.size() > kNamed ? absl::StrCat(first, ", ...") : first;
}

}  // namespace pepeseg
