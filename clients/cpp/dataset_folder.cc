#include "clients/cpp/dataset_folder.h"

#include <algorithm>
#include <initializer_list>
#include <system_error>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/file_bytes.h"

namespace pepeseg::client {
namespace {

namespace fs = std::filesystem;

bool EndsIn(absl::string_view name, std::initializer_list<absl::string_view> extensions) {
  const std::string lower = absl::AsciiStrToLower(name);
  return std::any_of(extensions.begin(), extensions.end(),
                     [&](absl::string_view extension) { return absl::EndsWith(lower, extension); });
}

// Returns the kind of sparse/0/NAME or sparse/NAME.
std::optional<v1::FileKind> ColmapKind(absl::string_view name) {
  // COLMAP writes sparse/0/; some tools leave out the 0.
  name.remove_prefix(absl::string_view("sparse/").size());
  if (absl::StartsWith(name, "0/")) name.remove_prefix(2);
  for (const absl::string_view extension : {".bin", ".txt"}) {
    if (name == absl::StrCat("cameras", extension) || name == absl::StrCat("images", extension)) {
      return v1::FILE_KIND_POSES;
    }
    if (name == absl::StrCat("points3D", extension)) return v1::FILE_KIND_POINTS;
  }
  return std::nullopt;
}

bool IsPhotograph(absl::string_view name) {
  return EndsIn(name, {".jpg", ".jpeg", ".png", ".webp", ".heic", ".heif"});
}

bool IsVideo(absl::string_view name) {
  return EndsIn(name, {".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi"});
}

bool HasPictures(const DatasetFolder& folder) {
  return Has(folder, v1::FILE_KIND_IMAGE) || Has(folder, v1::FILE_KIND_VIDEO);
}

// Moves the photographs and videos in the folder itself from `left_out` to `files`, under the names
// that the layout demands.
void TakeLoosePictures(const fs::path& root, DatasetFolder& folder) {
  std::vector<std::string> left_out;
  for (const std::string& name : folder.left_out) {
    std::error_code ignored;
    const bool loose =
        name.find('/') == std::string::npos && fs::is_regular_file(root / name, ignored);
    if (loose && IsPhotograph(name)) {
      folder.files.push_back({"images/" + name, v1::FILE_KIND_IMAGE, root / name});
    } else if (loose && IsVideo(name)) {
      folder.files.push_back({"videos/" + name, v1::FILE_KIND_VIDEO, root / name});
    } else {
      left_out.push_back(name);
    }
  }
  folder.left_out = std::move(left_out);
}

}  // namespace

bool Has(const DatasetFolder& folder, v1::FileKind kind) {
  return std::any_of(folder.files.begin(), folder.files.end(),
                     [&](const FolderFile& file) { return file.kind == kind; });
}

std::optional<v1::FileKind> KindOf(absl::string_view name, v1::FileKind in_depth) {
  const auto in = [&](absl::string_view folder) { return absl::StartsWith(name, folder); };
  if (in("images/") && IsPhotograph(name)) return v1::FILE_KIND_IMAGE;
  if ((in("videos/") || in("images/")) && IsVideo(name)) return v1::FILE_KIND_VIDEO;
  if (in("sparse/")) return ColmapKind(name);
  if (name == "transforms.json" || name == "poses_bounds.npy") return v1::FILE_KIND_POSES;
  if (in("masks/") && EndsIn(name, {".json", ".png", ".npy"})) return v1::FILE_KIND_MASK;
  if (name == "ignore_mask.png") return v1::FILE_KIND_IGNORE_MASK;
  if (in("ignore/") && EndsIn(name, {".png"})) return v1::FILE_KIND_IGNORE_MASK;
  // nerfstudio writes sparse_pc.ply.
  if (name == "points.ply" || name == "sparse_pc.ply") return v1::FILE_KIND_POINTS;
  if (name == "gaussians.ply") return v1::FILE_KIND_GAUSSIANS;
  const bool map = EndsIn(name, {".png", ".npy", ".pfm"});
  if (in("depth/") && map) return in_depth;
  if (in("disparity/") && map) return v1::FILE_KIND_DISPARITY;
  return std::nullopt;
}

absl::StatusOr<DatasetFolder> ReadDatasetFolder(const fs::path& folder, v1::FileKind in_depth) {
  std::error_code error;
  // A single video instead of a folder.
  if (IsVideo(folder.filename().string()) && fs::is_regular_file(folder, error)) {
    const std::string name = "videos/" + folder.filename().string();
    return DatasetFolder{{{name, v1::FILE_KIND_VIDEO, folder}}, {}};
  }
  if (!fs::is_directory(folder, error)) {
    return LocalFileMissing(absl::StrCat("no such folder or video: ", folder.string()));
  }
  DatasetFolder result;
  auto entry = fs::recursive_directory_iterator(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    std::error_code ignored;  // a dangling link is not a regular file and is left out
    if (entry->is_directory(ignored)) continue;
    const std::string name = entry->path().lexically_relative(folder).generic_string();
    const std::optional<v1::FileKind> kind = KindOf(name, in_depth);
    if (kind && entry->is_regular_file(ignored)) {
      result.files.push_back({name, *kind, entry->path()});
    } else {
      result.left_out.push_back(name);
    }
  }
  if (error) {
    return LocalFileError("list", folder, error.value());
  }
  // A plain folder of photographs works, too, but only if nothing is laid out.
  if (!HasPictures(result)) TakeLoosePictures(folder, result);
  std::sort(result.files.begin(), result.files.end(),
            [](const FolderFile& a, const FolderFile& b) { return a.name < b.name; });
  std::sort(result.left_out.begin(), result.left_out.end());
  if (!HasPictures(result)) {
    return absl::InvalidArgumentError(absl::StrCat(
        folder.string(),
        ": no photographs (.jpg, .jpeg, .png, .webp, .heic or .heif) and no videos (.mp4, .m4v, "
        ".mov, .webm, .mkv or .avi), in it or in its images/ and videos/"));
  }
  return result;
}

}  // namespace pepeseg::client
