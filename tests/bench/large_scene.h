#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tests/bench/large_scene_rays.h"

namespace pepeseg {

// A ray-traced place with detail of many sizes, as photographs of a megapixel show it: thousands of
// leaves, stones and small things, textures down to a pixel, shadows, gloss.
enum class Place {
  kYard,      // bushes, grass, gravel, brick walls and hills under a sky
  kWorkshop,  // shelves and a bench full of boxes and balls in a closed room
  kTable,     // things on a table in a closed room, none of which touches another
};

// The pieces of a place and their materials. Equal seeds give equal pieces.
struct PlacePieces {
  std::vector<Material> materials;
  std::vector<Piece> pieces;
  int num_things = 0;
};
PlacePieces MakePlace(Place place, uint64_t seed);

class LargeScene {
 public:
  // A thing that is not in the pictures.
  struct LeftOut {
    int thing = 0;  // its label; 0: none
    bool keeps_shadow = false;
  };
  LargeScene(Place place, uint64_t seed, const LeftOut& left_out);

  SceneSpans spans() const {
    return {pieces_.data(), num_large_, nodes_.data(), materials_.data(),
            has_sky_,       to_lamp_,   unseen_};
  }
  int num_things() const { return num_things_; }
  const std::vector<Piece>& pieces() const { return pieces_; }
  const std::vector<PieceNode>& nodes() const { return nodes_; }
  const std::vector<Material>& materials() const { return materials_; }

 private:
  void BuildNode(int first, int end);

  bool has_sky_;
  uint16_t unseen_;
  Float3 to_lamp_;
  int num_things_ = 0;
  int num_large_ = 0;
  std::vector<Material> materials_;
  std::vector<Piece> pieces_;
  std::vector<PieceNode> nodes_;
};

// A photograph and the label of each pixel's centre.
struct ScenePicture {
  std::vector<uint8_t> bgr;      // [height, width, 3]
  std::vector<uint16_t> labels;  // [height, width]
};
ScenePicture PhotographScene(const LargeScene& scene, const SceneCamera& camera);
// The same on a GPU; one thread at a time. Returns nothing where there is none.
class ScenePhotographer {
 public:
  explicit ScenePhotographer(const LargeScene& scene);
  ~ScenePhotographer();
  ScenePhotographer(const ScenePhotographer&) = delete;
  ScenePhotographer& operator=(const ScenePhotographer&) = delete;

  bool ready() const { return ready_; }
  ScenePicture Photograph(const SceneCamera& camera);

 private:
  bool ready_ = false;
  SceneSpans spans_ = {};  // on the device
  void *pieces_ = nullptr, *nodes_ = nullptr, *materials_ = nullptr;
};

}  // namespace pepeseg
