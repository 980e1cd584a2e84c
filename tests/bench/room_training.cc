#include "tests/bench/room_training.h"

#include <algorithm>
#include <span>

namespace pepeseg {

RoomTraining::RoomTraining(Backend& backend, int64_t count, int width, int height)
    : backend_(backend),
      count_(count),
      width_(width),
      height_(height),
      gaussians_(backend, count * NumPlanes(kMaxShDegree)),
      moment1_(backend, gaussians_.size()),
      moment2_(backend, gaussians_.size()),
      num_steps_(backend, count),
      mean2d_grad_(backend, count),
      square_sum_(backend, count),
      num_visible_(backend, count),
      max_radius_(backend, count),
      color_(backend, int64_t{3} * width * height),
      color_grad_(backend, color_.size()),
      sums_(backend, kNumImageLossSums) {
  TakePhotographs();
  gaussians_.Upload(MakeRoomScene(count, 1).planes);
}

// Renders another room as the photographs.
void RoomTraining::TakePhotographs() {
  gaussians_.Upload(MakeRoomScene(count_, 2).planes);
  std::vector<float> color(color_.size());
  const int64_t num_pixels = int64_t{width_} * height_;
  for (int view = 0; view < kNumViews; ++view) {
    Render(view);
    color_.Download(color);
    std::vector<uint8_t> bytes(color.size());
    for (int64_t i = 0; i < num_pixels; ++i) {
      for (int c = 0; c < 3; ++c) {
        bytes[3 * i + c] =
            static_cast<uint8_t>(255 * std::clamp(color[c * num_pixels + i], 0.0f, 1.0f));
      }
    }
    photographs_.emplace_back(backend_, std::span<const uint8_t>(bytes));
  }
}

void RoomTraining::Step(int view) {
  Render(view);
  ImageLoss(view);
  RenderBackward(view);
  Update(view);
}

void RoomTraining::Render(int view) {
  RenderArgs args;
  args.gaussians = Planes(gaussians_);
  args.view = RoomView(view, kNumViews, width_, height_);
  args.active_sh_degree = kMaxShDegree;
  args.tile_entry_capacity = tile_entry_capacity_;
  args.scratch = &scratch_;
  args.color = color_.span();
  backend_.Render(args);
}

void RoomTraining::ImageLoss(int view) {
  ImageLossArgs args;
  args.width = width_;
  args.height = height_;
  args.color = color_.span();
  args.target = photographs_[view].span();
  args.color_grad = color_grad_.span();
  args.sums = sums_.span();
  backend_.ImageLoss(args);
}

void RoomTraining::RenderBackward(int view) {
  RenderBackwardArgs args;
  args.view = RoomView(view, kNumViews, width_, height_);
  args.color_grad = color_grad_.span();
  args.scratch = &scratch_;
  backend_.RenderBackward(args);
}

void RoomTraining::Update(int view) {
  const UpdateStep step = {.view = RoomView(view, kNumViews, width_, height_),
                           .scratch = &scratch_};
  UpdateArgs args;
  args.steps = {&step, 1};
  args.active_sh_degree = kMaxShDegree;
  args.learning_rates = {1e-5f, 5e-3f, 1e-3f, 5e-2f, 2.5e-3f, 1.25e-4f};
  args.min_log_scale = -12;
  args.max_log_scale = 1;
  args.gaussians = Planes(gaussians_);
  args.moment1 = Planes(moment1_);
  args.moment2 = Planes(moment2_);
  args.num_steps = num_steps_.span();
  args.stats = {.mean2d_grad_sum = mean2d_grad_.span(),
                .square_sum = square_sum_.span(),
                .num_visible = num_visible_.span(),
                .max_radius = max_radius_.span()};
  backend_.Update(args);
}

std::vector<int64_t> RoomTraining::Counters() const {
  std::vector<int64_t> counters(kNumRenderCounters);
  scratch_.counters.Download(counters);
  return counters;
}

std::vector<double> RoomTraining::Sums() const {
  std::vector<double> sums(kNumImageLossSums);
  sums_.Download(sums);
  return sums;
}

std::vector<float> RoomTraining::Gaussians() const {
  std::vector<float> planes(gaussians_.size());
  gaussians_.Download(planes);
  return planes;
}

}  // namespace pepeseg
