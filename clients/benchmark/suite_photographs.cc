#include "clients/benchmark/suite_photographs.h"

#include <algorithm>
#include <map>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

std::string StemOf(const std::string& name) {
  return fs::path(name).replace_extension().generic_string();
}

std::vector<std::string> Photographs(const fs::path& folder) {
  std::vector<std::string> names = SortedNames(folder);
  std::erase_if(names, [](const std::string& name) {
    return KindOf("images/" + name) != v1::FILE_KIND_IMAGE;
  });
  return names;
}

// Returns the folder of the photographs to use. INVALID_ARGUMENT: none has any.
absl::StatusOr<std::string> ChooseImages(const fs::path& folder, const std::string& images) {
  std::vector<std::string> candidates = {"images_4", "images_8", "images_2", "images"};
  if (!images.empty()) candidates = {images};
  for (const std::string& candidate : candidates) {
    if (!Photographs(folder / candidate).empty()) return candidate;
  }
  return absl::InvalidArgumentError(absl::StrCat(folder.string(), ": no photographs: looked for ",
                                                 absl::StrJoin(candidates, "/, "), "/ in it"));
}

// Returns the original's name for each copy.
absl::StatusOr<std::map<std::string, std::string>> MatchCopies(
    const std::vector<std::string>& copies, const std::vector<std::string>& originals,
    const std::string& where) {
  std::map<std::string, std::string> original_of;
  if (originals.empty()) {
    for (const std::string& copy : copies) original_of[copy] = copy;
    return original_of;
  }
  std::map<std::string, std::string> by_stem;
  for (const std::string& original : originals) by_stem[StemOf(original)] = original;
  const bool same_names = std::all_of(copies.begin(), copies.end(), [&](const std::string& copy) {
    return by_stem.contains(StemOf(copy));
  });
  if (!same_names && copies.size() != originals.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": ", copies.size(), " photographs, and ", originals.size(),
                     " originals of other names in images/: they cannot be matched"));
  }
  for (size_t i = 0; i < copies.size(); ++i) {
    original_of[copies[i]] = same_names ? by_stem[StemOf(copies[i])] : originals[i];
  }
  return original_of;
}

// Returns true if poses of this file are used. `named`: the names that COLMAP's poses have are
// known.
bool IsUsed(const std::string& pose_file, bool named, bool has_sparse, bool has_bounds) {
  const bool sparse = absl::StartsWith(pose_file, "sparse/");
  return sparse == (has_sparse && (named || !has_bounds));
}

}  // namespace

bool IsFolder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

std::vector<std::string> SortedNames(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder, error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!absl::StartsWith(name, ".")) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

absl::StatusOr<DatasetFolder> ReadLlffScene(const fs::path& folder, const std::string& images) {
  ASSIGN_OR_RETURN(const std::string chosen, ChooseImages(folder, images));
  const std::vector<std::string> originals = Photographs(folder / "images");
  const std::vector<std::string> copies = Photographs(folder / chosen);
  ASSIGN_OR_RETURN(const auto original_of,
                   MatchCopies(copies, originals, (folder / chosen).string()));
  DatasetFolder dataset;
  std::map<std::string, std::string> stem_of;  // original's by the copy's
  for (const auto& [copy, original] : original_of) {
    dataset.files.push_back({"images/" + original, v1::FILE_KIND_IMAGE, folder / chosen / copy});
    stem_of[StemOf(copy)] = StemOf(original);
  }
  const bool has_sparse = IsFolder(folder / "sparse");
  std::error_code error;
  const bool has_bounds = fs::exists(folder / "poses_bounds.npy", error);
  if (!has_sparse && !has_bounds) {
    return absl::InvalidArgumentError(absl::StrCat(
        folder.string(), ": no poses: looked for sparse/0/ and poses_bounds.npy in it"));
  }
  auto entry = fs::recursive_directory_iterator(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    std::string name = entry->path().lexically_relative(folder).generic_string();
    const auto kind = KindOf(name);
    if (!kind || *kind == v1::FILE_KIND_IMAGE || *kind == v1::FILE_KIND_VIDEO) continue;
    if (*kind == v1::FILE_KIND_POSES && !IsUsed(name, !originals.empty(), has_sparse, has_bounds)) {
      continue;
    }
    // masks/image000.json and masks/image000/3.png belong to the copy image000.png.
    const size_t slash = name.find('/');
    if (*kind != v1::FILE_KIND_POSES && slash != std::string::npos) {
      const size_t end = std::min(name.find('/', slash + 1), name.rfind('.'));
      const auto stem = stem_of.find(name.substr(slash + 1, end - slash - 1));
      if (stem != stem_of.end()) name.replace(slash + 1, end - slash - 1, stem->second);
    }
    dataset.files.push_back({name, *kind, entry->path()});
  }
  std::sort(dataset.files.begin(), dataset.files.end(),
            [](const FolderFile& a, const FolderFile& b) { return a.name < b.name; });
  return dataset;
}

std::vector<std::string> ViewsOf(const DatasetFolder& dataset) {
  std::vector<std::string> views;
  for (const FolderFile& file : dataset.files) {
    if (file.kind != v1::FILE_KIND_IMAGE) continue;
    views.push_back(file.name.substr(absl::string_view("images/").size()));
  }
  std::sort(views.begin(), views.end());
  return views;
}

std::optional<std::string> ViewOfStem(const std::vector<std::string>& views,
                                      absl::string_view stem) {
  for (const std::string& view : views) {
    if (view == stem || StemOf(view) == stem) return view;
  }
  size_t index = 0;
  absl::string_view digits = stem;
  if (absl::ConsumePrefix(&digits, "image") && absl::SimpleAtoi(digits, &index) &&
      index < views.size()) {
    return views[index];
  }
  return std::nullopt;
}

}  // namespace pepeseg::client::cli
