// Compares SAM's encoder on a backend's own kernels with ONNX Runtime's, and times it.
//   pepeseg_sam_encoder_bench ENCODER_ONNX REFERENCES [cpu]        on CUDA, or on the CPU
// REFERENCES is a folder that pepeseg_sam_references has written.

#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "core/priors/sam/encoder_network.h"
#include "kernels/half.h"
#include "tests/bench/bench_clock.h"
#include "tests/testing/relative_rms.h"

namespace pepeseg {
namespace {

std::vector<char> ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Returns an empty image if there is no such file.
Image ReadRgb(const std::filesystem::path& path) {
  const std::vector<char> bytes = ReadBytes(path);
  int32_t size[2] = {0, 0};
  if (bytes.size() < sizeof(size)) return {};
  std::memcpy(size, bytes.data(), sizeof(size));
  return {size[0], size[1], 3, {bytes.begin() + sizeof(size), bytes.end()}};
}

std::vector<float> ReadHalves(const std::filesystem::path& path) {
  const std::vector<char> bytes = ReadBytes(path);
  std::vector<float> values(bytes.size() / sizeof(Half));
  for (size_t i = 0; i < values.size(); ++i) {
    Half half;
    std::memcpy(&half, &bytes[i * sizeof(Half)], sizeof(Half));
    values[i] = FloatFromHalf(half);
  }
  return values;
}

std::unique_ptr<Backend> MakeBackend(bool cpu, std::vector<KernelTime>* times) {
  if (cpu) return MakeCpuBackend(0);
  std::string error;
  auto backend = MakeCudaBackend({.kernel_times = times}, &error);
  if (backend == nullptr) std::printf("%s\n", error.c_str());
  return backend;
}

// Milliseconds of one call, the best of `rounds`, with the photographs' way to the device.
double BestTime(EncoderNetwork& network, Backend& backend, std::span<const Image* const> photos,
                int rounds) {
  double best = 1e9;
  NetworkBuffer embeddings;
  for (int k = 0; k < rounds; ++k) {
    backend.Sync();
    const double start = NowMs();
    if (!network.Encode(photos, &embeddings).ok()) return -1;
    backend.Sync();
    best = std::min(best, NowMs() - start);
  }
  return best;
}

// Prints the time of each kernel in one call on a batch of photographs.
void PrintKernels(const char* onnx, Precision precision, std::span<const Image* const> photos) {
  std::vector<KernelTime> times;
  const auto backend = MakeBackend(false, &times);
  auto network = EncoderNetwork::Load(onnx, *backend, precision);
  if (!network.ok()) return;
  constexpr int kRounds = 5;
  BestTime(**network, *backend, photos, 2);
  times.clear();
  BestTime(**network, *backend, photos, kRounds);
  double sum = 0;
  for (const KernelTime& time : times) {
    std::printf("  %-20s %8.4f ms %5d calls\n", time.name.c_str(), time.ms / kRounds,
                static_cast<int>(time.calls / kRounds));
    sum += time.ms / kRounds;
  }
  std::printf("  all kernels %.4f ms for %d photographs\n", sum, static_cast<int>(photos.size()));
}

int RunPrecision(const char* onnx, const std::vector<Image>& photos,
                 const std::vector<std::vector<float>>& want, bool cpu, Precision precision) {
  const auto backend = MakeBackend(cpu, nullptr);
  if (backend == nullptr) return 1;
  std::printf("%s, %s\n", backend->name().c_str(),
              precision == Precision::kHalf ? "half" : "float");
  auto loaded = EncoderNetwork::Load(onnx, *backend, precision);
  if (!loaded.ok()) {
    std::printf("%s\n", std::string(loaded.status().message()).c_str());
    return 1;
  }
  EncoderNetwork& network = **loaded;
  const int64_t size = network.shape().embedding_size();
  std::vector<std::vector<float>> alone;
  for (size_t k = 0; k < photos.size(); ++k) {
    const Image* photo = &photos[k];
    NetworkBuffer embeddings;
    const absl::Status status = network.Encode({&photo, 1}, &embeddings);
    if (!status.ok()) std::printf("%s\n", std::string(status.message()).c_str());
    alone.push_back(embeddings.Download());
    std::printf("  photograph %d (%d x %d): relative rms error %.3g\n", static_cast<int>(k),
                photo->width, photo->height, testing::RelativeRms(alone.back(), want[k]));
  }
  if (cpu) return 0;
  std::vector<const Image*> batch;
  for (int k = 0; k < 8; ++k) batch.push_back(&photos[k % photos.size()]);
  NetworkBuffer embeddings;
  if (!network.Encode(batch, &embeddings).ok()) return 1;
  const std::vector<float> together = embeddings.Download();
  int num_different = 0;
  for (int k = 0; k < 8; ++k) {
    num_different +=
        std::memcmp(&together[k * size], alone[k % photos.size()].data(), size * 4) != 0 ? 1 : 0;
  }
  std::printf("  of a batch of 8, %d differ from the photographs alone\n", num_different);
  std::printf("  memory %.1f MB at most\n",
              static_cast<double>(backend->peak_bytes_in_use()) / 1e6);
  const double one = BestTime(network, *backend, std::span(batch).first(1), 20);
  const double eight = BestTime(network, *backend, batch, 10);
  std::printf("  batch 1: %.3f ms, batch 8: %.3f ms per photograph\n", one, eight / 8);
  PrintKernels(onnx, precision, std::span<const Image* const>(batch).first(1));
  PrintKernels(onnx, precision, batch);
  return 0;
}

int Compare(const char* onnx, const std::filesystem::path& folder, bool cpu) {
  std::vector<Image> photos;
  std::vector<std::vector<float>> want;
  for (int k = 0;; ++k) {
    Image photo = ReadRgb(folder / (std::to_string(k) + ".rgb"));
    if (photo.pixels.empty()) break;
    photos.push_back(std::move(photo));
    want.push_back(ReadHalves(folder / (std::to_string(k) + ".half")));
  }
  if (photos.empty()) {
    std::printf("%s has no references\n", folder.c_str());
    return 1;
  }
  const int failed = RunPrecision(onnx, photos, want, cpu, Precision::kFloat);
  if (failed != 0 || cpu) return failed;
  return RunPrecision(onnx, photos, want, cpu, Precision::kHalf);
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  if (argc < 3) {
    std::printf("usage: %s ENCODER_ONNX REFERENCES [cpu]\n", argv[0]);
    return 2;
  }
  return pepeseg::Compare(argv[1], argv[2], argc > 3);
}
