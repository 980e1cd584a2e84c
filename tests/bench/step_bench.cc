// Measures one step of stage one at 800x600 with 100,000 Gaussians of SH degree 3: core-ms (user
// and system time of the process, over all threads) by op. Usage:
//   pepeseg_step_bench [gaussians] [width] [height] [threads] [steps]

#include <cstdio>
#include <cstdlib>
#include <span>
#include <vector>

#include "tests/bench/bench_clock.h"
#include "tests/bench/room_training.h"

namespace pepeseg {
namespace {

constexpr int kNumViews = RoomTraining::kNumViews;

struct Op {
  const char* name;
  void (RoomTraining::*run)(int view);
  double core_ms = 0;  // sum over the steps
};

// Adds the time of each op.
void Step(Backend& backend, RoomTraining& training, int view, std::span<Op> ops) {
  for (Op& op : ops) {
    const double start = CoreNow();
    (training.*op.run)(view);
    backend.Sync();
    op.core_ms += 1e3 * (CoreNow() - start);
  }
}

int Main(std::span<char*> argv) {
  const auto number = [&](size_t i, int otherwise) {
    return argv.size() > i ? std::atoi(argv[i]) : otherwise;
  };
  const int count = number(1, 100'000), width = number(2, 800), height = number(3, 600);
  const int only_threads = number(4, 0), num_steps = number(5, 24);
  for (int threads = 1; threads <= 2; ++threads) {
    if (only_threads != 0 && threads != only_threads) continue;
    const auto backend = MakeCpuBackend(threads);
    RoomTraining training(*backend, count, width, height);
    for (int step = 0; step < kNumViews; ++step) training.Step(step);
    std::vector<Op> ops = {{"Render", &RoomTraining::Render},
                           {"ImageLoss", &RoomTraining::ImageLoss},
                           {"RenderBackward", &RoomTraining::RenderBackward},
                           {"Update", &RoomTraining::Update}};
    double entries = 0, visible = 0;
    for (int step = 0; step < num_steps; ++step) {
      Step(*backend, training, step % kNumViews, ops);
      const std::vector<int64_t> counters = training.Counters();
      // Candidates in the tile of a pixel.
      entries += 256.0 * static_cast<double>(counters[kNumTileEntries]) / width / height;
      visible += static_cast<double>(counters[kNumVisible]);
    }
    std::printf("%s: %d Gaussians (%.0f visible), %dx%d, %.1f entries per pixel, %d steps\n",
                backend->name().c_str(), count, visible / num_steps, width, height,
                entries / num_steps, num_steps);
    double total = 0;
    for (const Op& op : ops) {
      std::printf("  %-16s %8.2f core-ms\n", op.name, op.core_ms / num_steps);
      total += op.core_ms / num_steps;
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
