#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace pepeseg {

// A ray-traced place with detail of many sizes, as photographs of a megapixel show it: thousands of
// leaves, stones and small things, textures down to a pixel, shadows, gloss. World: x right, y down,
// metres; the ground is at y = 0.

enum class Place {
  kYard,      // bushes, grass, gravel, brick walls and hills under a sky
  kWorkshop,  // shelves and a bench full of boxes, jars and tools in a closed room
};

// Pattern of two colours on a surface.
struct Material {
  Eigen::Vector3f color, other;  // linear, [0, 1]
  float size = 0.1f;             // of the largest spots of the pattern, metres
  bool bricks = false;           // courses of bricks of this height in place of spots
  float gloss = 0;               // share of the light that is mirrored straight on
};

// A box or an ellipsoid: where |to_unit (p - center)| <= 1, by the largest coordinate or the length.
struct Piece {
  Eigen::Matrix3f to_unit;
  Eigen::Vector3f center;
  bool is_box = false;
  uint16_t material = 0;
  uint16_t thing = 0;  // label from 1 on; 0: surroundings
};

struct LargeHit {
  float distance = 0;  // in lengths of the direction
  const Piece* piece = nullptr;
  Eigen::Vector3f normal;  // of length 1, towards the ray's origin
};

class LargeScene {
 public:
  // The same place for the same seed.
  LargeScene(Place place, uint64_t seed);

  std::optional<LargeHit> Trace(const Eigen::Vector3f& origin,
                                const Eigen::Vector3f& direction) const;
  // Returns the linear colour that a ray sees. `spread`: width of a pixel at distance 1.
  Eigen::Vector3f Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                        float spread) const;

  int num_things() const { return num_things_; }
  size_t num_pieces() const { return pieces_.size(); }

 private:
  // A box of the hierarchy. A leaf has `count` pieces from `first` on; else count is 0 and its
  // children are the node after it and the node `first`.
  struct Node {
    Eigen::Vector3f low, high;
    int first = 0, count = 0;
  };

  void BuildNode(int first, int end, int depth);
  std::optional<LargeHit> Walk(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                               float most, bool any) const;
  Eigen::Vector3f SkyColor(const Eigen::Vector3f& direction) const;
  Eigen::Vector3f PatternColor(const Material& material, const Eigen::Vector3f& at,
                               float footprint) const;

  Place place_;
  Eigen::Vector3f to_lamp_;
  int num_things_ = 0;
  std::vector<Material> materials_;
  std::vector<Piece> pieces_;  // large ones first, which no node has
  int num_large_ = 0;
  std::vector<Node> nodes_;
};

}  // namespace pepeseg
