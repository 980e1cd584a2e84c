// Measures one step of stage one at 800x600 with 100,000 Gaussians of SH degree 3: core-ms (user
// and system time of the process, over all threads) by op. Usage:
//   pepeseg_step_bench [gaussians] [width] [height] [threads] [steps]

#include <sys/resource.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <vector>

#include "kernels/backend.h"
#include "tests/bench/room_scene.h"

namespace pepeseg {
namespace {

constexpr int kNumViews = 8;
enum Op { kRender, kImageLoss, kRenderBackward, kUpdate, kNumOps };
constexpr const char* kOpNames[] = {"Render", "ImageLoss", "RenderBackward", "Update"};

double CoreMs() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& t) { return 1e3 * t.tv_sec + 1e-3 * t.tv_usec; };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

// A scene that is trained towards photographs of another one.
class StepBench {
 public:
  StepBench(Backend& backend, const RoomScene& scene, int width, int height)
      : backend_(backend),
        count_(scene.count),
        width_(width),
        height_(height),
        gaussians_(backend, std::span<const float>(scene.planes)),
        moment1_(backend, gaussians_.size()),
        moment2_(backend, gaussians_.size()),
        num_steps_(backend, count_),
        mean2d_grad_(backend, count_),
        square_sum_(backend, count_),
        num_visible_(backend, count_),
        max_radius_(backend, count_),
        color_(backend, int64_t{3} * width * height),
        color_grad_(backend, color_.size()),
        sums_(backend, kNumImageLossSums) {}

  // Render the photographs from the scene as it is now.
  void TakePhotographs() {
    std::vector<float> color(color_.size());
    const int64_t num_pixels = int64_t{width_} * height_;
    for (int view = 0; view < kNumViews; ++view) {
      Render(view);
      color_.Download(color);
      std::vector<uint8_t> bytes(color.size());
      for (int64_t i = 0; i < num_pixels; ++i) {
        for (int c = 0; c < 3; ++c) {
          const float value = color[c * num_pixels + i];
          bytes[3 * i + c] = static_cast<uint8_t>(value > 1 ? 255 : 255 * value);
        }
      }
      photographs_.emplace_back(backend_, std::span<const uint8_t>(bytes));
    }
  }
  void Load(const RoomScene& scene) { gaussians_.Upload(scene.planes); }

  void Step(int view, std::array<double, kNumOps>& core_ms) {
    double before = CoreMs();
    const auto lap = [&](Op op) {
      backend_.Sync();
      const double now = CoreMs();
      core_ms[op] += now - before;
      before = now;
    };
    Render(view);
    lap(kRender);
    ImageLossArgs loss;
    loss.width = width_;
    loss.height = height_;
    loss.color = color_.span();
    loss.target = photographs_[view].span();
    loss.color_grad = color_grad_.span();
    loss.sums = sums_.span();
    backend_.ImageLoss(loss);
    lap(kImageLoss);
    RenderBackwardArgs backward;
    backward.view = RoomView(view, kNumViews, width_, height_);
    backward.color_grad = color_grad_.span();
    backward.scratch = &scratch_;
    backend_.RenderBackward(backward);
    lap(kRenderBackward);
    Update(view);
    lap(kUpdate);
  }

  double EntriesPerPixel() const {  // candidates in the tile of a pixel
    int64_t counters[kNumRenderCounters];
    scratch_.counters.Download(counters);
    return 256.0 * static_cast<double>(counters[kNumTileEntries]) / width_ / height_;
  }
  int64_t NumVisible() const {
    int64_t counters[kNumRenderCounters];
    scratch_.counters.Download(counters);
    return counters[kNumVisible];
  }

 private:
  GaussianPlanes Planes(Buffer<float>& buffer) const {
    return {buffer.span().data, count_, count_, kMaxShDegree};
  }
  void Render(int view) {
    RenderArgs args;
    args.gaussians = Planes(gaussians_);
    args.view = RoomView(view, kNumViews, width_, height_);
    args.active_sh_degree = kMaxShDegree;
    args.scratch = &scratch_;
    args.color = color_.span();
    backend_.Render(args);
  }
  void Update(int view) {
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

  Backend& backend_;
  int64_t count_;
  int width_, height_;
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

int Main(std::span<char*> argv) {
  const auto number = [&](size_t i, int otherwise) {
    return argv.size() > i ? std::atoi(argv[i]) : otherwise;
  };
  const int count = number(1, 100'000), width = number(2, 800), height = number(3, 600);
  const int only_threads = number(4, 0), num_steps = number(5, 24);
  for (int threads = 1; threads <= 2; ++threads) {
    if (only_threads != 0 && threads != only_threads) continue;
    const auto backend = MakeCpuBackend(threads);
    StepBench bench(*backend, MakeRoomScene(count, 2), width, height);
    bench.TakePhotographs();
    bench.Load(MakeRoomScene(count, 1));
    std::array<double, kNumOps> warm_up = {}, core_ms = {};
    for (int step = 0; step < kNumViews; ++step) bench.Step(step, warm_up);
    double entries = 0, visible = 0;
    for (int step = 0; step < num_steps; ++step) {
      bench.Step(step % kNumViews, core_ms);
      entries += bench.EntriesPerPixel() / num_steps;
      visible += static_cast<double>(bench.NumVisible()) / num_steps;
    }
    std::printf("%s: %d Gaussians (%.0f visible), %dx%d, %.1f entries per pixel, %d steps\n",
                backend->name().c_str(), count, visible, width, height, entries, num_steps);
    double total = 0;
    for (int op = 0; op < kNumOps; ++op) {
      std::printf("  %-16s %8.2f core-ms\n", kOpNames[op], core_ms[op] / num_steps);
      total += core_ms[op] / num_steps;
    }
    std::printf("  %-16s %8.2f core-ms\n", "step", total);
  }
  return 0;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  return pepeseg::Main(std::span<char*>(argv, static_cast<size_t>(argc)));
}
