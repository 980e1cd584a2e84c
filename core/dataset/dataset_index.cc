#include "core/dataset/dataset_index.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/photo_names.h"
#include "core/dataset/transforms_json.h"
#include "core/formats/transforms_references.h"

namespace pepeseg {
namespace {

// Returns the error for two files of which only one may exist.
absl::Status TwoFor(const std::string& what, const DatasetFile& a, const DatasetFile& b) {
  return absl::InvalidArgumentError(absl::StrCat("two ", what, ": ", a.name, " and ", b.name));
}

// Adds a file to a map of the index. `what` and `key` describe it in the error for a second one.
absl::Status Put(const DatasetFile& file, const std::string& key, const std::string& what,
                 std::map<std::string, const DatasetFile*>& index) {
  const auto [entry, added] = index.try_emplace(key, &file);
  return added ? absl::OkStatus() : TwoFor(absl::StrCat(what, key), *entry->second, file);
}

std::string StemBelow(const std::string& name, absl::string_view folder) {
  return std::string(WithoutSuffix(WithoutFolder(name, folder)));
}

// Returns the name of the photograph, without suffix, of a file below depth/ or disparity/.
std::string DepthStem(const std::string& name) {
  const bool in_depth = WithoutFolder(name, "depth").size() < name.size();
  return StemBelow(name, in_depth ? "depth" : "disparity");
}

// Adds an ignore mask of one photograph, or the one for all.
absl::Status PutIgnoreMask(const DatasetFile& file, DatasetIndex& index) {
  if (WithoutFolder(file.name, "ignore") != "ignore_mask.png") {
    return Put(file, StemBelow(file.name, "ignore"), "ignore masks for ", index.ignore);
  }
  if (index.ignore_all != nullptr) return TwoFor("ignore masks for all", *index.ignore_all, file);
  index.ignore_all = &file;
  return absl::OkStatus();
}

// The files of one COLMAP model, which are in one folder. An upload may hold several models.
struct ColmapModel {
  std::map<std::string, const DatasetFile*> files;  // by name below the folder

  // Returns the file of that stem, or null. Prefers the binary form, as COLMAP does.
  const DatasetFile* Find(const std::string& stem) const {
    for (const char* suffix : {".bin", ".txt"}) {
      const auto found = files.find(stem + suffix);
      if (found != files.end()) return found->second;
    }
    return nullptr;
  }
};

// Lists the folders that have cameras and images. The map is sorted by folder, so that the list
// does not depend on the order of the upload.
void ListModels(const std::map<std::string, ColmapModel>& models, DatasetIndex& index) {
  for (const auto& [folder, model] : models) {
    const ColmapFiles files = {model.Find("cameras"), model.Find("images"), model.Find("points3D")};
    if (files.cameras != nullptr && files.images != nullptr) index.colmap_models.push_back(files);
  }
}

// Chooses the file of poses to use, and warns of the others.
void ChoosePoses(DatasetIndex& index) {
  // In the order of preference.
  const DatasetFile* colmap =
      index.colmap_models.empty() ? nullptr : index.colmap_models.front().images;
  const std::pair<PoseFormat, const DatasetFile*> formats[] = {
      {PoseFormat::kColmap, colmap},
      {PoseFormat::kTransformsJson, index.transforms},
      {PoseFormat::kPosesBounds, index.poses_bounds}};
  const DatasetFile* used = nullptr;
  for (const auto& [format, file] : formats) {
    if (file == nullptr) continue;
    if (used == nullptr) {
      used = file;
      index.pose_format = format;
    } else {
      index.warnings.push_back(
          absl::StrCat("the poses of ", used->name, " are used, not those of ", file->name));
    }
  }
}

// Drops nerfstudio's points if COLMAP's poses are used: nerfstudio rotates the world, so the points
// fit only the poses of its transforms.json, which names them.
void DropRotatedPoints(const TransformsReferences& references, DatasetIndex& index) {
  if (index.pose_format != PoseFormat::kColmap || index.transforms == nullptr) return;
  if (index.ply_points == nullptr) return;
  const std::string& name = index.ply_points->name;
  const bool named = !references.points.empty() && references.points.ends_with(name);
  if (!named && !name.ends_with("sparse_pc.ply")) return;
  index.warnings.push_back(absl::StrCat(index.ply_points->name, " belongs to the poses of ",
                                        index.transforms->name, " and is left out"));
  index.ply_points = nullptr;
}

// Adds a file of a COLMAP model to the model of its folder.
absl::Status PutModelFile(const DatasetFile& file, std::map<std::string, ColmapModel>& models) {
  const size_t slash = file.name.rfind('/');
  const size_t start = slash == std::string::npos ? 0 : slash + 1;
  return Put(file, file.name.substr(start), "files ", models[file.name.substr(0, start)].files);
}

// Adds a file of poses. The suffix tells the formats apart: .json and .npy, else COLMAP.
absl::Status PutPoses(const DatasetFile& file, std::map<std::string, ColmapModel>& models,
                      DatasetIndex& index) {
  const std::string suffix = Suffix(file.name);
  if (suffix != ".json" && suffix != ".npy") return PutModelFile(file, models);
  const DatasetFile*& place = suffix == ".json" ? index.transforms : index.poses_bounds;
  if (place != nullptr) return TwoFor("files of poses", *place, file);
  place = &file;
  return absl::OkStatus();
}

absl::Status PutPoints(const DatasetFile& file, std::map<std::string, ColmapModel>& models,
                       DatasetIndex& index) {
  // A client may declare COLMAP's points3D as points instead of as poses.
  if (file.name.ends_with("points3D.bin") || file.name.ends_with("points3D.txt")) {
    return PutModelFile(file, models);
  }
  index.point_clouds.push_back(&file);
  return absl::OkStatus();
}

// Adds a file by its kind. Files of COLMAP models are collected in `models` first.
absl::Status PutFile(const DatasetFile& file, std::map<std::string, ColmapModel>& models,
                     DatasetIndex& index) {
  switch (file.kind) {
    case FileKind::kImage:
      return Put(file, PhotoKey(file.name), "photographs ", index.photos);
    case FileKind::kMask:
      return Put(file, StemBelow(file.name, "masks"), "mask files for ", index.masks);
    case FileKind::kIgnoreMask:
      return PutIgnoreMask(file, index);
    case FileKind::kPoses:
      return PutPoses(file, models, index);
    case FileKind::kPoints:
      return PutPoints(file, models, index);
    case FileKind::kGaussians:
      if (index.gaussians != nullptr) return TwoFor("files of Gaussians", *index.gaussians, file);
      index.gaussians = &file;
      return absl::OkStatus();
    case FileKind::kDepth:
    case FileKind::kDisparity:
      return Put(file, DepthStem(file.name), "depth maps for ", index.depth);
    case FileKind::kVideo:  // its frames are indexed as photographs
      return absl::OkStatus();
  }
  return absl::OkStatus();
}

// Moves the PNGs below a folder that is named as a photograph, masks/STEM/NAME.png, to
// `mask_folders`. A PNG that is itself named as a photograph is a label image and stays.
absl::Status TakeMaskFolders(const std::set<std::string>& stems, DatasetIndex& index) {
  for (auto entry = index.masks.begin(); entry != index.masks.end();) {
    const auto [stem, file] = *entry;
    const size_t slash = stem.rfind('/');
    const bool in_folder = Suffix(file->name) == ".png" && slash != std::string::npos &&
                           !stems.contains(stem) && stems.contains(stem.substr(0, slash));
    if (in_folder) index.mask_folders[stem.substr(0, slash)].push_back(file);
    entry = in_folder ? index.masks.erase(entry) : std::next(entry);
  }
  for (const auto& [stem, folder] : index.mask_folders) {
    const auto file = index.masks.find(stem);
    if (file == index.masks.end()) continue;
    return TwoFor(absl::StrCat("forms of masks for ", stem), *file->second, *folder.front());
  }
  return absl::OkStatus();
}

// Returns what transforms.json names; nothing if there is none or it cannot be read, which is an
// error only where its poses are used.
TransformsReferences ReadReferences(const DatasetIndex& index) {
  if (index.transforms == nullptr) return {};
  const auto text = ReadFile(index.transforms->path, index.transforms->name, kMaxTransformsBytes);
  if (!text.ok()) return {};
  return ParseTransformsReferences(*text).value_or(TransformsReferences());
}

// Finds files by the paths that transforms.json gives them.
class FilesByPath {
 public:
  void Add(const DatasetFile* file) {
    by_name_.emplace(file->name, file);
    const auto [entry, added] = by_folded_.try_emplace(FoldName(file->name), file);
    if (!added) entry->second = nullptr;  // ambiguous
  }

  // Returns the file with that name, or with a name that is the end of `path`; null if there is
  // none. Exact names take precedence over those that differ as FoldName says.
  const DatasetFile* Find(const std::string& path) const {
    const DatasetFile* exact = FindIn(by_name_, path);
    return exact != nullptr ? exact : FindIn(by_folded_, FoldName(path));
  }

 private:
  using Files = std::map<std::string, const DatasetFile*>;
  static const DatasetFile* FindIn(const Files& files, const std::string& path) {
    return FindBelowFolders<const DatasetFile*>(path, nullptr, [&](const std::string& name) {
      const auto found = files.find(name);
      return found == files.end() ? nullptr : found->second;
    });
  }

  Files by_name_, by_folded_;
};

// Moves the masks that frames name from the masks, the ignore masks and the photographs to `keep`.
void TakeKeepMasks(const TransformsReferences& references, DatasetIndex& index) {
  FilesByPath files;
  for (const auto* kind : {&index.masks, &index.ignore, &index.photos}) {
    for (const auto& [name, file] : *kind) files.Add(file);
  }
  std::set<const DatasetFile*> shown;  // photographs of frames, which are no masks
  {
    const PhotoNames photos(index.photos);
    for (const auto& frame : references.frames) {
      const auto photo = index.photos.find(photos.Find(frame.photo));
      if (photo != index.photos.end()) shown.insert(photo->second);
    }
  }
  std::set<std::string> missing;
  std::map<std::string, const DatasetFile*> taken;  // by path
  for (const auto& [photo, mask] : references.frames) {
    if (mask.empty()) continue;
    const DatasetFile* file = files.Find(mask);
    if (file == nullptr || shown.contains(file)) {
      missing.insert(mask);
    } else {
      taken.emplace(mask, file);
    }
  }
  std::set<const DatasetFile*> masks;
  for (const auto& [path, file] : taken) masks.insert(file);
  for (auto* kind : {&index.masks, &index.ignore, &index.photos}) {
    std::erase_if(*kind, [&](const auto& entry) { return masks.contains(entry.second); });
  }
  const PhotoNames photos(index.photos);
  for (const auto& [photo, mask] : references.frames) {
    const auto file = taken.find(mask);
    const std::string key = photos.Find(photo);
    if (file == taken.end() || key.empty()) continue;
    index.keep[std::string(WithoutSuffix(key))] = file->second;
  }
  if (!masks.empty()) {
    index.warnings.push_back(absl::StrCat(
        masks.size(), " masks that ", index.transforms->name,
        " names (mask_path) say what to use: their pixels of value 0 are ignored, and they are not "
        "segments"));
  }
  if (!missing.empty()) {
    index.warnings.push_back(absl::StrCat(missing.size(), " masks that ", index.transforms->name,
                                          " names (mask_path) are not among the files: ",
                                          *missing.begin(), missing.size() > 1 ? ", ..." : ""));
  }
}

// Chooses the cloud that transforms.json names, else the only one.
absl::Status ChoosePoints(const TransformsReferences& references, DatasetIndex& index) {
  FilesByPath clouds;
  for (const DatasetFile* cloud : index.point_clouds) clouds.Add(cloud);
  if (!references.points.empty()) index.ply_points = clouds.Find(references.points);
  if (index.ply_points != nullptr) return absl::OkStatus();
  if (index.point_clouds.size() > 1) {
    return TwoFor("point clouds", *index.point_clouds[0], *index.point_clouds[1]);
  }
  if (!index.point_clouds.empty()) index.ply_points = index.point_clouds.front();
  if (!references.points.empty()) {
    index.warnings.push_back(absl::StrCat(
        index.transforms->name, ": its points, ", references.points,
        " (ply_file_path), are not among the files: the training starts from ",
        index.ply_points == nullptr ? "others, or random ones" : index.ply_points->name));
  }
  return absl::OkStatus();
}

// Gives masks, ignore masks and depth maps the name of their photograph where the two differ in
// letters, in Unicode's form, or in a suffix in the middle ("7.jpg.png" of 7.jpg).
// `stems`: names of the photographs without suffix.
void MatchCompanions(const std::set<std::string>& stems, DatasetIndex& index) {
  const PhotoNames photos(index.photos);
  for (auto* files : {&index.masks, &index.ignore, &index.depth}) {
    std::map<std::string, const DatasetFile*> matched;
    for (const auto& [stem, file] : *files) {
      const std::string photo = stems.contains(stem) ? stem : photos.FindWhole(stem);
      const std::string key = photo.empty() ? stem : std::string(WithoutSuffix(photo));
      const bool free = !files->contains(key) && !matched.contains(key);
      matched.emplace(stems.contains(stem) || !free ? stem : key, file);
    }
    *files = std::move(matched);
  }
}

}  // namespace

int64_t CountSegmentMasks(std::span<const DatasetFile> files) {
  DatasetIndex index;
  for (const DatasetFile& file : files) {
    // By whole names: IndexDataset refuses two files with one purpose, which is nothing to report
    // here.
    if (IsSystemFile(file.name)) continue;
    if (file.kind == FileKind::kMask) index.masks[file.name] = &file;
    if (file.kind == FileKind::kIgnoreMask) index.ignore[file.name] = &file;
    if (file.kind == FileKind::kImage) index.photos[PhotoKey(file.name)] = &file;
    if (file.kind == FileKind::kPoses && Suffix(file.name) == ".json") index.transforms = &file;
  }
  if (!index.masks.empty()) TakeKeepMasks(ReadReferences(index), index);
  return static_cast<int64_t>(index.masks.size());
}

absl::StatusOr<DatasetIndex> IndexPriors(std::span<const DatasetFile> files,
                                         std::span<const std::string> photographs) {
  DatasetIndex index;
  std::map<std::string, ColmapModel> models;  // stays empty: priors have no poses
  for (const DatasetFile& file : files) {
    RETURN_IF_ERROR(ValidateName(file.name));
    RETURN_IF_ERROR(PutFile(file, models, index));
  }
  std::set<std::string> stems;
  for (const std::string& name : photographs) stems.emplace(WithoutSuffix(name));
  RETURN_IF_ERROR(TakeMaskFolders(stems, index));
  return index;
}

absl::StatusOr<DatasetIndex> IndexDataset(std::span<const DatasetFile> files) {
  DatasetIndex index;
  std::map<std::string, ColmapModel> models;
  int num_system = 0;
  for (const DatasetFile& file : files) {
    RETURN_IF_ERROR(ValidateName(file.name));
    if (IsSystemFile(file.name)) {
      ++num_system;
    } else {
      RETURN_IF_ERROR(PutFile(file, models, index));
    }
  }
  if (num_system > 0) {
    index.warnings.push_back(absl::StrCat(
        num_system, " files that systems leave in folders (._NAME, .DS_Store) are left out"));
  }
  const TransformsReferences references = ReadReferences(index);
  TakeKeepMasks(references, index);
  if (index.photos.empty()) return absl::InvalidArgumentError("no photographs among the files");
  std::set<std::string> stems;
  for (const auto& [name, photo] : index.photos) stems.emplace(WithoutSuffix(name));
  RETURN_IF_ERROR(ChoosePoints(references, index));
  MatchCompanions(stems, index);
  RETURN_IF_ERROR(TakeMaskFolders(stems, index));
  ListModels(models, index);
  ChoosePoses(index);
  DropRotatedPoints(references, index);
  return index;
}

}  // namespace pepeseg
