#include "core/sfm/starting_cameras.h"

#include <algorithm>
#include <map>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr double kSidesPerFocal = 1.2;  // COLMAP's default
constexpr double kFilmWidth = 35;       // as COLMAP divides by, though film is 36 mm wide

DatabaseCamera StartingCamera(const SfmPhotograph& photograph) {
  DatabaseCamera camera;
  camera.width = photograph.header.width;
  camera.height = photograph.header.height;
  const double side = std::max(camera.width, camera.height);
  const int on_film = photograph.camera.focal_length_35_mm;
  camera.knows_focal = on_film > 0;
  const double focal = camera.knows_focal ? on_film / kFilmWidth * side : kSidesPerFocal * side;
  camera.params = {focal, camera.width / 2.0, camera.height / 2.0, 0};
  return camera;
}

}  // namespace

std::vector<DatabaseCamera> StartingCameras(std::span<const SfmPhotograph> photographs) {
  const std::vector<size_t> indices = CameraIndices(photographs);
  std::vector<DatabaseCamera> cameras;
  for (size_t i = 0; i < photographs.size(); ++i) {
    if (indices[i] < cameras.size()) continue;
    cameras.push_back(StartingCamera(photographs[i]));
    cameras.back().id = static_cast<int64_t>(cameras.size());
  }
  return cameras;
}

bool NeedsSensorSize(const ExifCamera& camera) {
  return camera.focal_length > 0 && camera.focal_length_35_mm <= 0;
}

absl::Status LookUpSensors(std::span<const SfmPhotograph> photographs,
                           const std::filesystem::path& images, const std::filesystem::path& work,
                           const ColmapProgram& program, SfmWatch& watch,
                           std::vector<DatabaseCamera>& cameras) {
  const std::vector<size_t> indices = CameraIndices(photographs);
  const std::vector<std::string> names = SafeNames(photographs);
  std::map<size_t, std::string> asked;  // a photograph of each camera
  std::string list;
  for (size_t i = 0; i < photographs.size(); ++i) {
    if (!NeedsSensorSize(photographs[i].camera) || !asked.emplace(indices[i], names[i]).second) {
      continue;
    }
    absl::StrAppend(&list, names[i], "\n");
    // COLMAP makes cameras for photographs with features only; these have none.
    const std::filesystem::path text = work / (names[i] + ".txt");
    std::error_code ignored;  // WriteFileAtomically fails next
    std::filesystem::create_directories(text.parent_path(), ignored);
    RETURN_IF_ERROR(WriteFileAtomically(text, "0 128\n"));
  }
  if (asked.empty()) return absl::OkStatus();
  const std::filesystem::path database = work / "sensors.db", list_path = work / "asked.txt";
  RETURN_IF_ERROR(WriteFileAtomically(list_path, list));
  RETURN_IF_ERROR(watch.Run(
      program,
      {"feature_importer",
       {"--database_path", database.string(), "--image_path", images.string(), "--image_list_path",
        list_path.string(), "--import_path", work.string(), "--ImageReader.camera_model",
        "SIMPLE_RADIAL", "--ImageReader.single_camera_per_folder", "1"},
       ""}));
  ASSIGN_OR_RETURN(const DatabaseFeatures found, ReadDatabaseFeatures(database));
  for (const auto& [index, name] : asked) {
    for (const DatabaseImage& image : found.images) {
      const DatabaseCamera& camera = found.cameras[image.camera];
      if (image.name != name || camera.params.size() != cameras[index].params.size()) continue;
      cameras[index].params = camera.params;
      cameras[index].knows_focal = camera.knows_focal;
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
