#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/front/colmap_database.h"
#include "core/sfm/sfm_photographs.h"
#include "core/sfm/sfm_watch.h"

// The cameras from which the estimation of poses starts: those that COLMAP 3.8 makes when it
// extracts features.
namespace pepeseg {

// Returns the cameras of photographs in the order of CameraIndices, with ids from 1: SIMPLE_RADIAL
// without distortion, the principal point in the middle. The focal length is that of EXIF for 35 mm
// film, else 1.2 times the longer side.
std::vector<DatabaseCamera> StartingCameras(std::span<const SfmPhotograph> photographs);

// Returns true if the EXIF data has a focal length, but not that for 35 mm film: it needs the size
// of the sensor, which COLMAP knows of many cameras.
bool NeedsSensorSize(const ExifCamera& camera);

// Asks COLMAP for the focal lengths of the cameras that need a sensor's size, and sets them. Reads
// one photograph of each from `images`, which LayOut filled, and leaves files in `work`. Does
// nothing if no camera needs it. Errors of SfmWatch::Run and ReadDatabaseFeatures.
absl::Status LookUpSensors(std::span<const SfmPhotograph> photographs,
                           const std::filesystem::path& images, const std::filesystem::path& work,
                           const ColmapProgram& program, SfmWatch& watch,
                           std::vector<DatabaseCamera>& cameras);

}  // namespace pepeseg
