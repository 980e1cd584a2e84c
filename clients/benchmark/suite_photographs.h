#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "clients/cpp/dataset_folder.h"

// The photographs of a benchmark's scene, and how other files name them.
namespace pepeseg::client::cli {

// Returns the names of what a folder contains, sorted, without hidden entries. Empty: there is no
// such folder.
std::vector<std::string> SortedNames(const std::filesystem::path& folder);
bool IsFolder(const std::filesystem::path& path);

// Returns the files of an LLFF scene as a dataset. LLFF keeps shrunk copies of its photographs in
// images_4/ and so on, mostly as imageNNN.png, while COLMAP's poses name the originals in images/:
// the copies are uploaded under the originals' names, matched by name or else by order. Masks,
// depth maps and points are taken as by ReadDatasetFolder; masks that are named as the copies are
// renamed, too. If there are no originals, poses_bounds.npy is preferred, which needs no names.
// `images`: see SceneSearch. INVALID_ARGUMENT: photographs or poses are missing, or the copies and
// the originals differ in number.
absl::StatusOr<DatasetFolder> ReadLlffScene(const std::filesystem::path& folder,
                                            const std::string& images);

// Returns the names of the dataset's photographs as those of views, sorted.
std::vector<std::string> ViewsOf(const DatasetFolder& dataset);

// Returns the view that `stem` names: a name without suffix, or "imageNNN", the NNNth view, from 0.
std::optional<std::string> ViewOfStem(const std::vector<std::string>& views,
                                      absl::string_view stem);

}  // namespace pepeseg::client::cli
