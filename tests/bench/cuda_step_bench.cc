// Measures one step of stage one on a CUDA device, SH of degree 3, no depth: total, and by kernel
// next to the lower bound from bytes and operations. Usage:
//   pepeseg_cuda_step_bench [gaussians] [width] [height] [steps]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "tests/bench/bench_clock.h"
#include "tests/bench/room_training.h"

namespace pepeseg {
namespace {

constexpr int kNumViews = RoomTraining::kNumViews;

// Returns the time of a step, median over repeats, with steps queued one after another.
double StepMs(Backend& backend, RoomTraining& training, int num_steps) {
  std::vector<double> repeats;
  for (int repeat = 0; repeat < 7; ++repeat) {
    backend.Sync();
    const double start = NowMs();
    for (int step = 0; step < num_steps; ++step) training.Step(step % kNumViews);
    backend.Sync();
    repeats.push_back((NowMs() - start) / num_steps);
  }
  std::nth_element(repeats.begin(), repeats.begin() + 3, repeats.end());
  return repeats[3];
}

struct Workload {
  double gaussians = 0, visible = 0, entries = 0, pixels = 0;  // means over the views
  double most_entries = 0;
};

Workload Measure(RoomTraining& training, int64_t count, int width, int height) {
  Workload out;
  out.gaussians = static_cast<double>(count);
  out.pixels = static_cast<double>(width) * height;
  for (int view = 0; view < kNumViews; ++view) {
    training.Render(view);
    const auto counters = training.Counters();
    out.visible += static_cast<double>(counters[kNumVisible]) / kNumViews;
    const auto entries = static_cast<double>(counters[kNumTileEntries]);
    out.entries += entries / kNumViews;
    out.most_entries = std::max(out.most_entries, entries);
  }
  return out;
}

// Returns the bytes that a kernel must move: each input read once, each output written once.
double LeastMegabytes(const std::string& kernel, const Workload& w) {
  const double mega = 1e-6;
  if (kernel == "project") {
    return mega * (w.gaussians * (11 * 4 + 4) + w.visible * (48 * 4 + 48 + 8));
  }
  if (kernel == "list entries") return mega * (w.visible * 52 + w.entries * 16);
  if (kernel == "sort entries") return mega * w.entries * 5 * 24;  // five passes of 8 bits
  if (kernel == "tile ranges") return mega * w.entries * 20;
  if (kernel == "blend") return mega * (w.entries * (48 + 12 + 32) + w.pixels * 36);
  if (kernel == "blend backward") return mega * (w.entries * (48 + 8 + 40 + 32) + w.pixels * 32);
  if (kernel == "sum slots") return mega * (w.entries * 40 + w.visible * (48 + 40));
  if (kernel == "update") return mega * (w.gaussians * (59 * 24 + 24) + w.visible * 92);
  if (kernel == "loss moments") return mega * w.pixels * (12 + 3 + 36);
  if (kernel == "loss gradient") return mega * w.pixels * (36 + 12 + 3 + 12);
  return 0;
}

void PrintKernels(const std::vector<KernelTime>& times, const Workload& w, int num_steps) {
  constexpr double kGigabytesPerSecond = 4300;  // a device-to-device copy on an H200
  std::printf("| kernel | us | least MB | us at %.1f TB/s |\n|---|---|---|---|\n",
              kGigabytesPerSecond / 1000);
  double total = 0;
  for (const KernelTime& time : times) {
    const double megabytes = LeastMegabytes(time.name, w);
    std::printf("| %s | %.1f | %.1f | %.1f |\n", time.name.c_str(), 1e3 * time.ms / num_steps,
                megabytes, 1e3 * megabytes / kGigabytesPerSecond);
    total += time.ms;
  }
  std::printf("| all | %.1f | | |\n", 1e3 * total / num_steps);
}

int Main(std::span<char*> argv) {
  const auto number = [&](size_t i, int otherwise) {
    return argv.size() > i ? std::atoi(argv[i]) : otherwise;
  };
  const int count = number(1, 1'000'000), width = number(2, 1152), height = number(3, 868);
  const int num_steps = number(4, 64);
  std::string error;
  Workload workload;
  {
    const auto backend = MakeCudaBackend({}, &error);
    if (backend == nullptr) {
      std::fprintf(stderr, "%s\n", error.c_str());
      return 1;
    }
    RoomTraining training(*backend, count, width, height);
    workload = Measure(training, count, width, height);
    std::printf("%s: %d Gaussians (%.0f visible), %dx%d, %.2f M entries, %.1f per pixel\n",
                backend->name().c_str(), count, workload.visible, width, height,
                1e-6 * workload.entries, 256 * workload.entries / workload.pixels);
    const auto loss = [&] {
      const auto sums = training.Sums();
      return sums[kSumL1] / sums[kSumPixelChannels];
    };
    training.Step(0);
    const double first_loss = loss();
    const auto ample = static_cast<int64_t>(1.25 * workload.most_entries);
    for (const int64_t tile_entry_capacity : {int64_t{0}, ample}) {
      training.set_tile_entry_capacity(tile_entry_capacity);
      std::printf("step: %.3f ms (%s)\n", StepMs(*backend, training, num_steps),
                  tile_entry_capacity > 0 ? "a quarter more entry capacity than needed"
                                          : "growing the entry capacity");
    }
    training.Step(0);
    std::printf("L1 %.4f -> %.4f, %lld overflowed renders, %.0f MB in use\n", first_loss, loss(),
                static_cast<long long>(training.Counters()[kNumOverflowedRenders]),
                1e-6 * static_cast<double>(backend->bytes_in_use()));
    if (!backend->error().empty()) std::printf("ERROR %s\n", backend->error().c_str());
  }
  std::vector<KernelTime> times;
  const auto backend = MakeCudaBackend({.kernel_times = &times}, &error);
  RoomTraining training(*backend, count, width, height);
  for (int step = 0; step < kNumViews; ++step) training.Step(step);
  backend->Sync();
  times.clear();
  for (int step = 0; step < num_steps; ++step) training.Step(step % kNumViews);
  backend->Sync();
  PrintKernels(times, workload, num_steps);
  return 0;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  return pepeseg::Main(std::span<char*>(argv, static_cast<size_t>(argc)));
}
