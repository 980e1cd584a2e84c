#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/features/features.h"
#include "core/sfm/two_view/two_view_geometry.h"

// COLMAP's SQLite database: cameras, photographs and features in, verified matches out. It is
// written for COLMAP 3.8, whose files have user_version 3800. Later versions have other tables.
namespace pepeseg {

// A camera, which photographs share. COLMAP's model 2 is SIMPLE_RADIAL with f, cx, cy, k.
struct DatabaseCamera {
  int64_t id = 0;
  int model = 2;
  int width = 0, height = 0;  // pixels
  std::vector<double> params;
  bool knows_focal = false;  // true: the focal length is from EXIF; false: a default
};

struct DatabaseImage {
  int64_t id = 0;     // from 1, in the order of the names
  std::string name;   // relative to COLMAP's folder of photographs
  size_t camera = 0;  // index into DatabaseFeatures::cameras
  SfmFeatures features;
};

// The photographs of a capture after feature extraction.
struct DatabaseFeatures {
  std::vector<DatabaseCamera> cameras;
  std::vector<DatabaseImage> images;  // ids ascend
};

// Two photographs that were compared. first < second, indices into DatabaseFeatures::images.
struct ComparedPair {
  size_t first = 0, second = 0;
  std::vector<FeatureMatch> matches;
  TwoViewGeometry geometry;
};

// Reads cameras, photographs and features. FAILED_PRECONDITION: the database is of another version.
// DATA_LOSS, naming the file: it is damaged, or its values are out of range. INTERNAL: it cannot be
// read.
absl::StatusOr<DatabaseFeatures> ReadDatabaseFeatures(const std::filesystem::path& path);

// Returns the same with the photographs sorted by name, and ids from 1. COLMAP's own order depends
// on the timing of its threads, and its mapper on the order.
DatabaseFeatures SortedByName(DatabaseFeatures features);

// Creates a database with features; there must be no file of that name. INTERNAL: it cannot be
// written.
absl::Status CreateDatabase(const std::filesystem::path& path, const DatabaseFeatures& features);

// Writes compared pairs in one transaction, so that after an error the database is as before. A
// pair without matches is marked as compared as well, which COLMAP's matchers then skip. INTERNAL:
// it cannot be written, or holds one of the pairs already.
absl::Status WritePairs(const std::filesystem::path& path, const DatabaseFeatures& features,
                        std::span<const ComparedPair> pairs);

}  // namespace pepeseg
