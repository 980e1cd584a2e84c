#include "core/sfm/pair_evidence.h"

#include "core/sfm/mapper/focal_search.h"

namespace pepeseg {
namespace {

bool Turns(const ComparedDatabase& compared) {
  std::vector<double> focals;  // of each camera, 0: not known
  for (const DatabaseCamera& camera : compared.features.cameras) {
    focals.push_back(camera.knows_focal && !camera.params.empty() ? camera.params[0] : 0);
  }
  std::vector<MapperPhotograph> photographs;
  for (const DatabaseImage& image : compared.features.images) {
    const DatabaseCamera& camera = compared.features.cameras[image.camera];
    photographs.push_back({image.name,
                           camera.width,
                           camera.height,
                           static_cast<int>(image.camera),
                           focals[image.camera],
                           {}});
  }
  std::vector<VerifiedPair> pairs;
  for (const ComparedPair& pair : compared.pairs) {
    if (pair.geometry.inliers.empty()) continue;
    pairs.push_back(
        {static_cast<uint32_t>(pair.first), static_cast<uint32_t>(pair.second), pair.geometry});
  }
  return TurnsOnTheSpot(photographs, pairs, focals);
}

}  // namespace

PairEvidence JudgePairs(const ComparedDatabase& compared) {
  PairEvidence evidence;
  for (const DatabaseImage& image : compared.features.images) evidence.names.push_back(image.name);
  evidence.num_partners.resize(evidence.names.size());
  for (const ComparedPair& pair : compared.pairs) {
    if (pair.geometry.inliers.empty()) continue;
    ++evidence.num_partners[pair.first];
    ++evidence.num_partners[pair.second];
  }
  evidence.turns_on_the_spot = Turns(compared);
  return evidence;
}

}  // namespace pepeseg
