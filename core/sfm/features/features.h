#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

// Features of photographs, and which ones match: what the parts of stage "sfm" pass on.
namespace pepeseg {

// A SIFT feature of a photograph (Lowe 2004). In pixels as COLMAP counts them: the centre of the
// first pixel is (0.5, 0.5).
struct Keypoint {
  float x = 0, y = 0;
  float scale = 0;  // standard deviation of the blur at which it was found, pixels
  float angle = 0;  // direction of the gradient, radians, from x to y
};

// The features of one photograph.
struct SfmFeatures {
  static constexpr int kDescriptorSize = 128;

  std::vector<Keypoint> keypoints;  // [n]
  // [n, 128]: square roots of the L1-normalised gradient histogram, times 512, at most 255
  // (RootSIFT, Arandjelovic and Zisserman 2012, as COLMAP stores it).
  std::vector<uint8_t> descriptors;

  size_t size() const { return keypoints.size(); }
};

// A feature of one photograph and the feature of another one that matches it.
struct FeatureMatch {
  uint32_t first = 0, second = 0;  // indices into SfmFeatures::keypoints

  bool operator==(const FeatureMatch&) const = default;
};

}  // namespace pepeseg
