#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "kernels/backend.h"
#include "tests/bench/bench_backend.h"

// Times ExtractSift on grey photographs, and compares its features on CUDA with those on the CPU.
//
//   pepeseg_sift_bench [--cuda] [--threads N] [--repeat N] [--max-features N] [--out FOLDER]
//                      PHOTO.pgm...
//
// Prints, for each photograph, the least and the median time of a call: core seconds on the CPU,
// milliseconds on CUDA with the photograph already there, and the kernels' own. --out writes the
// features as text for `colmap feature_importer`, PHOTO.txt for PHOTO.pgm.

namespace pepeseg {
namespace {

struct Options {
  bool cuda = false;
  int num_threads = 1, repeat = 5, max_features = 3000;
  std::string out;
  std::vector<std::string> photographs;
};

struct Photograph {
  int width = 0, height = 0;
  std::vector<uint8_t> grey;
};

struct Features {
  std::vector<SiftKeypoint> keypoints;
  std::vector<uint8_t> descriptors;
  std::vector<double> seconds;  // of each call
};

[[noreturn]] void Die(const std::string& why) {
  std::fprintf(stderr, "pepeseg_sift_bench: %s\n", why.c_str());
  std::exit(1);
}

Options ReadOptions(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto number = [&] { return ++i < argc ? std::atoi(argv[i]) : 0; };
    if (word == "--cuda") {
      options.cuda = true;
    } else if (word == "--threads") {
      options.num_threads = number();
    } else if (word == "--repeat") {
      options.repeat = std::max(1, number());
    } else if (word == "--max-features") {
      options.max_features = std::max(1, number());
    } else if (word == "--out" && i + 1 < argc) {
      options.out = argv[++i];
    } else {
      options.photographs.push_back(word);
    }
  }
  if (options.photographs.empty()) Die("name at least one PHOTO.pgm");
  return options;
}

Photograph ReadPgm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  Photograph photograph;
  int white = 0;
  file >> magic >> photograph.width >> photograph.height >> white;
  if (!file || magic != "P5" || white != 255) Die(path + " is not a PGM (P5) of 8 bits");
  file.get();
  photograph.grey.resize(static_cast<size_t>(photograph.width) * photograph.height);
  file.read(reinterpret_cast<char*>(photograph.grey.data()),
            static_cast<std::streamsize>(photograph.grey.size()));
  if (!file) Die(path + " is cut short");
  return photograph;
}

// Extracts the features `repeat` times, and once before to warm up. `clock` returns seconds.
Features Extract(Backend& backend, const Photograph& photograph, const Options& options,
                 double (*clock)()) {
  const Buffer<uint8_t> grey(backend, std::span<const uint8_t>(photograph.grey));
  SiftScratch scratch;
  Buffer<SiftKeypoint> keypoints;
  Buffer<uint8_t> descriptors;
  Features features;
  for (int k = -1; k < options.repeat; ++k) {
    const double begin = clock();
    backend.ExtractSift({.grey = grey.span(),
                         .width = photograph.width,
                         .height = photograph.height,
                         .ignore = {},
                         .max_features = options.max_features,
                         .scratch = &scratch,
                         .keypoints = &keypoints,
                         .descriptors = &descriptors});
    backend.Sync();
    if (k >= 0) features.seconds.push_back(clock() - begin);
  }
  if (!backend.error().empty()) Die(backend.error());
  std::sort(features.seconds.begin(), features.seconds.end());
  features.keypoints.resize(keypoints.size());
  features.descriptors.resize(descriptors.size());
  keypoints.Download(features.keypoints);
  descriptors.Download(features.descriptors);
  return features;
}

// Shares of the features of `want` that `got` has: at the same place within 0.3 pixels, and of
// these with the same direction and a descriptor at most 32 of 512 away.
void PrintAgreement(const Features& want, const Features& got) {
  int64_t num_placed = 0, num_alike = 0;
  for (size_t i = 0; i < want.keypoints.size(); ++i) {
    const SiftKeypoint& a = want.keypoints[i];
    bool placed = false, alike = false;
    for (size_t j = 0; j < got.keypoints.size(); ++j) {
      const SiftKeypoint& b = got.keypoints[j];
      if (std::hypot(a.x - b.x, a.y - b.y) > 0.3f || std::abs(a.scale / b.scale - 1) > 0.1f) {
        continue;
      }
      placed = true;
      int64_t squares = 0;
      for (int k = 0; k < kSiftDescriptorSize; ++k) {
        const int difference = want.descriptors[i * kSiftDescriptorSize + k] -
                               got.descriptors[j * kSiftDescriptorSize + k];
        squares += difference * difference;
      }
      alike |= squares <= 32 * 32;
    }
    num_placed += placed;
    num_alike += alike;
  }
  const auto count = static_cast<double>(std::max<size_t>(1, want.keypoints.size()));
  std::printf("  of the CPU's %zu features CUDA (%zu) has %.2f %%, with descriptor %.2f %%\n",
              want.keypoints.size(), got.keypoints.size(), 100 * num_placed / count,
              100 * num_alike / count);
}

void WriteText(const Features& features, const std::filesystem::path& path) {
  std::ofstream out(path);
  out << features.keypoints.size() << " " << kSiftDescriptorSize << "\n";
  for (size_t i = 0; i < features.keypoints.size(); ++i) {
    const SiftKeypoint& k = features.keypoints[i];
    out << k.x << " " << k.y << " " << k.scale << " " << k.angle;
    for (int j = 0; j < kSiftDescriptorSize; ++j) {
      out << " " << int{features.descriptors[i * kSiftDescriptorSize + j]};
    }
    out << "\n";
  }
  if (!out) Die("cannot write " + path.string());
}

// Prints the times of the kernels of one call.
void PrintKernels(const Photograph& photograph, Options options) {
  std::vector<KernelTime> times;
  std::string error;
  const auto backend = MakeCudaBackend({.kernel_times = &times}, &error);
  if (backend == nullptr) Die(error);
  Extract(*backend, photograph, options, Now);
  for (const KernelTime& time : times) {
    std::printf("  %-18s %8.3f ms\n", time.name.c_str(), time.ms / (options.repeat + 1));
  }
}

int Run(const Options& options) {
  const auto cpu = MakeCpuBackend(options.num_threads);
  std::string error;
  const auto cuda = options.cuda ? MakeCudaBackend({}, &error) : nullptr;
  if (options.cuda && cuda == nullptr) Die(error);
  std::printf("%s%s%s\n", cpu->name().c_str(), cuda ? ", " : "", cuda ? cuda->name().c_str() : "");
  for (const std::string& path : options.photographs) {
    const Photograph photograph = ReadPgm(path);
    const Features features = Extract(*cpu, photograph, options, CoreNow);
    std::printf("%s: %dx%d, %zu features, %.4f core s (median %.4f)\n", path.c_str(),
                photograph.width, photograph.height, features.keypoints.size(),
                features.seconds.front(), features.seconds[features.seconds.size() / 2]);
    if (!options.out.empty()) {
      const std::filesystem::path stem = std::filesystem::path(path).stem();
      WriteText(features, std::filesystem::path(options.out) / (stem.string() + ".txt"));
    }
    if (cuda == nullptr) continue;
    const Features on_device = Extract(*cuda, photograph, options, Now);
    std::printf("  CUDA: %.3f ms (median %.3f)\n", 1e3 * on_device.seconds.front(),
                1e3 * on_device.seconds[on_device.seconds.size() / 2]);
    PrintAgreement(features, on_device);
    PrintKernels(photograph, options);
  }
  return 0;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) { return pepeseg::Run(pepeseg::ReadOptions(argc, argv)); }
