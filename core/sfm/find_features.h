#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/sfm_photographs.h"
#include "core/sfm/sfm_watch.h"
#include "kernels/backend.h"

// The first step of stage "sfm": a COLMAP database with cameras, photographs and features.
namespace pepeseg {

// Photographs are shrunk to this longer side, pixels, before features are found. Few of the 3000
// largest features are lost by that.
inline constexpr int kFeatureSide = 2000;

struct FeatureTask {
  std::span<const SfmPhotograph> photographs;
  std::span<const std::string> safe_names;  // see SafeNames
  std::filesystem::path images;             // the folder that LayOut filled
  std::filesystem::path masks;              // the same; empty: no photograph has a mask
  std::filesystem::path sensors;            // a folder for LookUpSensors
  std::filesystem::path database;           // created
  int max_features = 0;                     // see SfmOptions
  int num_threads = 0;                      // 0: one for each core
};

// Finds features by COLMAP's feature_extractor. Errors of SfmWatch::Run.
absl::Status FindFeaturesByColmap(const FeatureTask& task, const ColmapProgram& program,
                                  SfmWatch& watch);

// Finds features by ExtractFeatures (core/sfm/features), and the cameras that COLMAP 3.8 would have
// (StartingCameras). FAILED_PRECONDITION: `program` is of another version, whose databases may be
// different. Errors of ExtractFeatures, LookUpSensors, CreateDatabase and SfmWatch.
absl::Status FindOwnFeatures(const FeatureTask& task, Backend& backend,
                             const ColmapProgram& program, SfmWatch& watch);

// Returns the peak host memory in bytes, by COLMAP or by pepeseg. `max_pixels` is the size of the
// largest photograph.
int64_t FeatureHostBytes(int64_t max_pixels, int num_threads, bool by_colmap);

}  // namespace pepeseg
