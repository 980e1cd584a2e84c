#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/benchmark/outlines.h"
#include "clients/terminal/picture.h"
#include "pepeseg/v1/evaluation_service.pb.h"

// Where the ground truth of a scene is: label images, or outlines.
namespace pepeseg::client::cli {

// The ground truth of one granularity level of a dataset: label images or outlines of views.
struct TruthLevel {
  std::string name;
  std::filesystem::path folder;                   // has STEM.png for views
  std::map<int, std::string> entities;            // names by id; an id without a name is absent
  std::vector<OutlinedPhotograph> outlines = {};  // in place of label images
};

// Returns whether a path exists; false if it cannot be looked up.
bool PathExists(const std::filesystem::path& path);

// Returns the levels of a dataset's folder. gt/labels.json lists them with the names of entities by
// id ({"part": ["-", "lamp", ...], ...}), and gt/LEVEL/ has their label images. Without that file
// there is one level, "labels", of the first that exists: label images in labels/; outlines in
// labels/ (see ReadOutlines), annotations.json or annotations/; LabelMe's outlines next to the
// photographs in images/. Without any of these there is none. INVALID_ARGUMENT: gt/labels.json is
// not a JSON object, or outlines are malformed.
absl::StatusOr<std::vector<TruthLevel>> FindTruth(const std::filesystem::path& dataset);

// Returns the levels at a path: as FindTruth does if that finds any, or if the path has images/.
// Otherwise the path is itself one of these places: a file or folder of outlines, or a folder with
// label images or masks, which exclude outlines. Returns errors as FindTruth does.
absl::StatusOr<std::vector<TruthLevel>> FindTruthAt(const std::filesystem::path& path);

// Adds the masks of the entities that are outlined in a photograph of `size` pixels, in images of
// FittingSize. Returns its errors.
absl::Status AddOutlines(const OutlinedPhotograph& outlines, const PixelSize& size,
                         v1::ViewTruth& truth);

// Returns the size to which an image of a photograph is scaled: the photograph's or, if only that
// has the image's shape, the one with its sides exchanged. Such an image is of the stored pixels of
// a photograph that lies on its side: the server turns it by the EXIF orientation.
// INVALID_ARGUMENT, with the path: the image has neither shape, up to the rounding of one pixel.
absl::StatusOr<PixelSize> FittingSize(const std::filesystem::path& path, const PixelSize& image,
                                      const PixelSize& photograph);

// Returns a label image as a PNG of FittingSize, resampled to the nearest pixel. INVALID_ARGUMENT:
// see FittingSize, or it is resampled and has an id over 255.
absl::StatusOr<std::string> LabelsPng(const std::filesystem::path& path,
                                      const PixelSize& photograph);

}  // namespace pepeseg::client::cli
