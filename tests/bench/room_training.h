#pragma once

#include <vector>

#include "kernels/backend.h"
#include "tests/bench/room_scene.h"

namespace pepeseg {

// A room that is trained on one backend towards photographs of another room: steps of stage one
// without depth, SH of degree 3.
class RoomTraining {
 public:
  static constexpr int kNumViews = 8;

  RoomTraining(Backend& backend, int64_t count, int width, int height);

  void Step(int view);
  void Render(int view);
  void ImageLoss(int view);
  void RenderBackward(int view);
  void Update(int view);

  // Tile-entry capacity, CUDA backend only, see RenderArgs.
  void set_tile_entry_capacity(int64_t tile_entry_capacity) {
    tile_entry_capacity_ = tile_entry_capacity;
  }
  std::vector<int64_t> Counters() const;
  std::vector<double> Sums() const;  // of the last ImageLoss
  std::vector<float> Gaussians() const;
  const RenderScratch& scratch() const { return scratch_; }

 private:
  GaussianPlanes Planes(Buffer<float>& buffer) const {
    return {buffer.span().data, count_, count_, kMaxShDegree};
  }
  void TakePhotographs();

  Backend& backend_;
  int64_t count_;
  int width_, height_;
  int64_t tile_entry_capacity_ = 0;
  Buffer<float> gaussians_, moment1_, moment2_;
  Buffer<int32_t> num_steps_;
  Buffer<float> mean2d_grad_, square_sum_;
  Buffer<int32_t> num_visible_;
  Buffer<float> max_radius_;
  Buffer<float> color_, color_grad_;
  Buffer<double> sums_;
  std::vector<Buffer<uint8_t>> photographs_;
  RenderScratch scratch_;
};

}  // namespace pepeseg
