#include "clients/cpp/dataset_folder.h"

#include <algorithm>
#include <fstream>
#include <initializer_list>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

namespace fs = std::filesystem;

bool EndsIn(absl::string_view name, std::initializer_list<absl::string_view> extensions) {
  const std::string lower = absl::AsciiStrToLower(name);
  return std::any_of(extensions.begin(), extensions.end(),
                     [&](absl::string_view extension) { return absl::EndsWith(lower, extension); });
}

// Returns the kind of sparse/N/NAME or sparse/NAME.
std::optional<v1::FileKind> ColmapKind(absl::string_view name) {
  // COLMAP writes sparse/0/, and sparse/1/ and so on where it could not join all photographs; some
  // tools leave out the number.
  name.remove_prefix(absl::string_view("sparse/").size());
  const absl::string_view number = name.substr(0, std::min(name.find('/'), name.size()));
  if (!number.empty() && std::all_of(number.begin(), number.end(), absl::ascii_isdigit)) {
    name.remove_prefix(std::min(number.size() + 1, name.size()));
  }
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

// Returns true for files that systems and programs leave next to photographs, as the server does.
bool IsSystemFile(absl::string_view name) {
  for (const absl::string_view part : absl::StrSplit(name, '/')) {
    if (absl::StartsWith(part, ".")) return true;
    for (const char* known : {"thumbs.db", "desktop.ini", "__macosx", "@eadir", "#recycle",
                              "$recycle.bin", "lost+found"}) {
      if (absl::EqualsIgnoreCase(part, known)) return true;
    }
  }
  return false;
}

// Returns the name without ending, in lower case.
std::string LowerStem(const std::string& name) {
  return absl::AsciiStrToLower(fs::path(name).replace_extension().generic_string());
}

// Moves the videos of Live Photos, which have the name of a photograph next to them, to `left_out`.
void LeaveOutLivePhotos(DatasetFolder& folder) {
  std::set<std::string> photographs;
  for (const FolderFile& file : folder.files) {
    if (file.kind != v1::FILE_KIND_IMAGE) continue;
    photographs.insert(LowerStem(file.path.generic_string()));
  }
  std::erase_if(folder.files, [&](const FolderFile& file) {
    const bool live = file.kind == v1::FILE_KIND_VIDEO &&
                      photographs.contains(LowerStem(file.path.generic_string()));
    if (live) folder.left_out.push_back(file.name);
    return live;
  });
}

// Returns the path with '/' and without ".", ".." and empty parts.
std::string PlainPath(absl::string_view path) {
  std::vector<std::string> parts =
      absl::StrSplit(absl::StrReplaceAll(path, {{"\\", "/"}}), '/', absl::SkipEmpty());
  std::erase_if(parts, [](const std::string& part) { return part == "." || part == ".."; });
  return absl::StrJoin(parts, "/");
}

// Returns the kinds of the points and masks that transforms.json names (ply_file_path, mask_path),
// by their paths in lower case, whatever their folders. A file that is not such JSON names none:
// the server says what is wrong.
std::map<std::string, v1::FileKind> ReferencesOf(const fs::path& root) {
  std::map<std::string, v1::FileKind> named;
  std::ifstream file(root / "transforms.json");
  const auto json = nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return named;
  const auto add = [&](const nlohmann::json& object, const char* key, v1::FileKind kind) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (found != object.end() && found->is_string()) {
      named.insert_or_assign(absl::AsciiStrToLower(PlainPath(found->get_ref<const std::string&>())),
                             kind);
    }
  };
  add(json, "mask_path", v1::FILE_KIND_MASK);
  const auto frames = json.find("frames");
  if (frames != json.end() && frames->is_array()) {
    for (const auto& frame : *frames) add(frame, "mask_path", v1::FILE_KIND_MASK);
  }
  add(json, "ply_file_path", v1::FILE_KIND_POINTS);
  return named;
}

// Returns the byte offset of the first byte that is not UTF-8, or npos.
size_t FirstBadByte(absl::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto lead = static_cast<uint8_t>(text[i]);
    const size_t size = lead < 0x80                   ? 1
                        : lead >= 0xc2 && lead < 0xe0 ? 2
                        : lead >= 0xe0 && lead < 0xf0 ? 3
                        : lead >= 0xf0 && lead < 0xf5 ? 4
                                                      : 0;
    if (size == 0 || i + size > text.size()) return i;
    for (size_t k = 1; k < size; ++k) {
      if ((static_cast<uint8_t>(text[i + k]) & 0xc0) != 0x80) return i;
    }
    i += size;
  }
  return absl::string_view::npos;
}

// Returns INVALID_ARGUMENT for a name that the contract's messages cannot hold.
absl::Status CheckName(const std::string& name) {
  if (FirstBadByte(name) == absl::string_view::npos) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the name \"", absl::CHexEscape(name),
                   "\" is not UTF-8; rename the file, for example with convmv -f latin1 -t utf8"));
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

bool IsLayoutFolder(absl::string_view lower) {
  for (const char* known :
       {"images", "videos", "masks", "ignore", "depth", "disparity", "sparse"}) {
    if (lower == known) return true;
  }
  return false;
}

// Returns the name with the layout's folder in lower case: "Images/7.jpg" is "images/7.jpg".
std::string InLayout(const std::string& name) {
  const size_t slash = name.find('/');
  if (slash == std::string::npos) return name;
  const std::string folder = absl::AsciiStrToLower(name.substr(0, slash));
  return IsLayoutFolder(folder) ? folder + name.substr(slash) : name;
}

// Returns the folder of the scene: that inside, if there is nothing else, as archives unpack to.
fs::path SceneFolder(fs::path folder) {
  constexpr int kDeepest = 4;
  for (int depth = 0; depth < kDeepest; ++depth) {
    fs::path only;
    int num = 0;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      if (IsSystemFile(entry.path().filename().string())) continue;
      ++num;
      only = entry.path();
    }
    const std::string name = absl::AsciiStrToLower(only.filename().string());
    if (num != 1 || !fs::is_directory(only, error) || IsLayoutFolder(name)) return folder;
    folder = only;
  }
  return folder;
}

// Returns where photographs were seen that the layout does not take, for an error; "" if nowhere.
std::string WhereElse(const DatasetFolder& folder) {
  for (const std::string& name : folder.left_out) {
    if (!IsPhotograph(name) && !IsVideo(name)) continue;
    const std::string parent = fs::path(name).parent_path().generic_string();
    return absl::StrCat("; there are some in ", parent, "/: name that folder, or call it images/");
  }
  return "";
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
  const fs::path root = SceneFolder(folder);
  // Before loose photographs are taken, because a mask that transforms.json names may be next to
  // them.
  const std::map<std::string, v1::FileKind> references = ReferencesOf(root);
  DatasetFolder result;
  auto entry = fs::recursive_directory_iterator(root, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    std::error_code ignored;  // a dangling link is not a regular file and is left out
    if (entry->is_directory(ignored)) continue;
    const std::string below = entry->path().lexically_relative(root).generic_string();
    if (IsSystemFile(below)) continue;
    const std::string name = InLayout(below);
    std::optional<v1::FileKind> kind = KindOf(name, in_depth);
    const auto reference = references.find(absl::AsciiStrToLower(below));
    if (reference != references.end()) {
      // A mask among the photographs is none of them.
      const bool is_mask = kind == v1::FILE_KIND_IMAGE && reference->second == v1::FILE_KIND_MASK;
      if (!kind || is_mask) kind = reference->second;
    }
    // Some tools write no points at all, and the contract has no files without bytes.
    if (kind == v1::FILE_KIND_POINTS && entry->file_size(ignored) == 0) kind.reset();
    if (kind) RETURN_IF_ERROR(CheckName(name));
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
  if (!HasPictures(result)) TakeLoosePictures(root, result);
  LeaveOutLivePhotos(result);
  for (const FolderFile& file : result.files) RETURN_IF_ERROR(CheckName(file.name));
  std::sort(result.files.begin(), result.files.end(),
            [](const FolderFile& a, const FolderFile& b) { return a.name < b.name; });
  std::sort(result.left_out.begin(), result.left_out.end());
  if (!HasPictures(result)) {
    return absl::InvalidArgumentError(absl::StrCat(
        folder.string(),
        ": no photographs (.jpg, .jpeg, .png, .webp, .heic or .heif) and no videos (.mp4, .m4v, "
        ".mov, .webm, .mkv or .avi), in it or in its images/ and videos/",
        WhereElse(result)));
  }
  return result;
}

}  // namespace pepeseg::client
