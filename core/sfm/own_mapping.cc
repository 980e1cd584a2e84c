#include "core/sfm/own_mapping.h"

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/sfm/colmap_model_writer.h"
#include "core/sfm/mapper/map_globally.h"

namespace pepeseg {
namespace {

// Pixels of the photographs as they were shrunk for features.
constexpr double kMostOffPair = 3;

// Photographs and pairs for the mapper, in pixels of the photographs as they were shrunk for
// features: its thresholds are about those.
struct ShrunkCapture {
  double scale = 1;  // at most 1
  std::vector<std::vector<Keypoint>> keypoints;
  std::vector<MapperPhotograph> photographs;
  std::vector<VerifiedPair> pairs;          // that match
  std::vector<PhotographIndices> compared;  // all
};

TwoViewGeometry Shrunk(TwoViewGeometry geometry, double scale) {
  const Eigen::Vector3d shrink(scale, scale, 1), enlarge(1 / scale, 1 / scale, 1);
  geometry.fundamental =
      (enlarge.asDiagonal() * geometry.fundamental * enlarge.asDiagonal()).eval();
  geometry.homography = (shrink.asDiagonal() * geometry.homography * enlarge.asDiagonal()).eval();
  geometry.fundamental.stableNormalize();
  geometry.homography.stableNormalize();
  return geometry;
}

ShrunkCapture Shrink(const ComparedDatabase& compared) {
  ShrunkCapture capture;
  capture.scale = compared.FeatureScale();
  const auto scaled = [&](double x) { return static_cast<float>(capture.scale * x); };
  for (const DatabaseImage& image : compared.features.images) {
    std::vector<Keypoint>& keypoints = capture.keypoints.emplace_back();
    for (const Keypoint& k : image.features.keypoints) {
      keypoints.push_back({scaled(k.x), scaled(k.y), scaled(k.scale), k.angle});
    }
  }
  for (size_t i = 0; i < compared.features.images.size(); ++i) {
    const DatabaseImage& image = compared.features.images[i];
    const DatabaseCamera& camera = compared.features.cameras[image.camera];
    const bool knows_focal = camera.knows_focal && !camera.params.empty();
    capture.photographs.push_back(
        {image.name, static_cast<int>(capture.scale * camera.width + 0.5),
         static_cast<int>(capture.scale * camera.height + 0.5), static_cast<int>(image.camera),
         knows_focal ? capture.scale * camera.params[0] : 0, capture.keypoints[i]});
  }
  for (const ComparedPair& pair : compared.pairs) {
    capture.compared.emplace_back(pair.first, pair.second);
    if (pair.geometry.inliers.empty()) continue;
    capture.pairs.push_back({static_cast<uint32_t>(pair.first), static_cast<uint32_t>(pair.second),
                             Shrunk(pair.geometry, capture.scale)});
  }
  return capture;
}

// Gives the lenses the sizes and focal lengths of the stored photographs. Poses and points stay.
void Enlarge(const ComparedDatabase& compared, double scale, GlobalModel& model) {
  model.lenses.resize(compared.features.cameras.size());
  for (size_t i = 0; i < model.lenses.size(); ++i) {
    GroupLens& lens = model.lenses[i];
    lens.width = compared.features.cameras[i].width;
    lens.height = compared.features.cameras[i].height;
    lens.focal /= scale;
    lens.shift /= scale;
  }
}

}  // namespace

absl::StatusOr<OwnMapping> MapByOwnMapper(const OwnMappingInput& input,
                                          absl::FunctionRef<absl::Status(double share)> progress) {
  const ShrunkCapture capture = Shrink(input.compared);
  MapperOptions options;
  options.num_threads = input.num_threads;
  options.max_error = kMostOffPair;
  options.compared = capture.compared;
  ASSIGN_OR_RETURN(MapperResult found,
                   MapGlobally(capture.photographs, capture.pairs, options, progress));
  OwnMapping mapping;
  if (found.gate != MapperGate::kPassed) {
    mapping.refusal =
        absl::StrCat("the mapper refused its model: ", std::string(GateName(found.gate)));
    return mapping;
  }
  Enlarge(input.compared, capture.scale, found.model);
  const DatabaseFeatures& features = input.compared.features;
  ASSIGN_OR_RETURN(const std::vector<PointColour> colours,
                   ColourPoints(input.photographs, features, found.model, input.num_threads));
  RETURN_IF_ERROR(WriteColmapModel(features, found.model, colours, input.folder));
  ASSIGN_OR_RETURN(SfmModel model, ReadSfmModel(input.folder));
  ASSIGN_OR_RETURN(mapping.mapped.agreement, MeasureAgreement(features, input.compared.pairs, model,
                                                              kMostOffEpipolar / capture.scale));
  mapping.mapped.models.push_back(std::move(model));
  if (!mapping.mapped.agreement.IsPlausible()) {
    mapping.refusal = "the mapper refused its model: matches contradict the poses";
  }
  return mapping;
}

}  // namespace pepeseg
