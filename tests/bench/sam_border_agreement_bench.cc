// Compares borders of masks by our kernels with those by ONNX Runtime on the CPU.
//   pepeseg_sam_border_agreement_bench SAM_FOLDER [--cuda] [--threads N] PHOTO LABELS [PHOTO LABELS
//   ...]
// Each label of a label image with at least 400 pixels is a prompt, as it is and grown by four
// pixels. Prints the IoU of the two refined masks, and the core seconds of each step.

#include <sys/resource.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "core/priors/sam/sam_borders.h"
#include "tests/bench/bench_backend.h"

namespace pepeseg {
namespace {

struct AgreementOptions {
  std::filesystem::path sam;
  bool cuda = false;
  int num_threads = 1;
  std::vector<std::string> files;  // photographs and their label images in turn
};

double AgreementOf(const BinaryMask& a, const BinaryMask& b) {
  double common = 0, united = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    common += a.pixels[i] & b.pixels[i];
    united += a.pixels[i] | b.pixels[i];
  }
  return united == 0 ? 1 : common / united;
}

// Returns the mask and all pixels within `radius` of it along both axes.
BinaryMask GrownBy(const BinaryMask& mask, int width, int height, int radius) {
  BinaryMask grown = mask;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (mask.pixels[static_cast<size_t>(y) * width + x] == 0) continue;
      for (int v = std::max(0, y - radius); v <= std::min(height - 1, y + radius); ++v) {
        const auto row = grown.pixels.begin() + static_cast<ptrdiff_t>(v) * width;
        std::fill(row + std::max(0, x - radius), row + std::min(width, x + radius + 1), uint8_t{1});
      }
    }
  }
  return grown;
}

// Core seconds and how often.
struct StepTime {
  double seconds = 0;
  int count = 0;
  template <class Call>
  auto Of(const Call& call) -> decltype(call()) {
    const double start = CoreNow();
    auto result = call();
    seconds += CoreNow() - start;
    ++count;
    return result;
  }
  double mean() const { return seconds / std::max(1, count); }
};

struct Agreement {
  std::vector<double> ious;
  double moved = 0;  // sum of 1 - IoU of a mask with its refined one

  void Print(const char* name) {
    std::ranges::sort(ious);
    double sum = 0;
    for (const double iou : ious) sum += iou;
    const auto count = static_cast<double>(ious.size());
    std::printf("%s: %zu masks, IoU mean %.5f, least %.5f; SAM moves them to an IoU of %.3f\n",
                name, ious.size(), sum / count, ious.front(), 1 - moved / count);
  }
};

// Returns the most resident memory of this process so far, MiB.
double MostResident() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

// Opens our networks and computes with them once, so that they have all of their memory.
absl::StatusOr<std::unique_ptr<SamBorders>> OpenOurs(const AgreementOptions& options) {
  SamOptions open = {.num_threads = options.num_threads};
  if (options.cuda) open.cuda_device = 0;
  ASSIGN_OR_RETURN(const Image photo, DecodePhoto(options.files[0], options.files[0]));
  BinaryMask upper;
  upper.pixels.resize(static_cast<size_t>(photo.width) * photo.height);
  std::fill_n(upper.pixels.begin(), upper.pixels.size() / 2, uint8_t{1});
  const double before = MostResident();
  ASSIGN_OR_RETURN(auto ours, SamBorders::Open(options.sam, open));
  ASSIGN_OR_RETURN(const SamEmbedding embedding, ours->Embed(photo));
  RETURN_IF_ERROR(ours->Refine(embedding, upper).status());
  std::printf("%s takes %.0f MiB of the host\n", ours->processor().c_str(),
              MostResident() - before);
  return ours;
}

absl::Status Run(const AgreementOptions& options) {
  ASSIGN_OR_RETURN(const auto ours, OpenOurs(options));
  const SamOptions by_onnx = {
      .num_threads = options.num_threads, .onnx_runtime = true, .mask_prompts = true};
  ASSIGN_OR_RETURN(const auto onnx, SamModel::Open(options.sam, by_onnx));
  const auto reference = onnx->MakeSegmenter();
  StepTime embed, refine, onnx_embed, onnx_refine;
  Agreement as_is, grown_masks;
  for (size_t i = 0; i + 1 < options.files.size(); i += 2) {
    ASSIGN_OR_RETURN(const Image photo, DecodePhoto(options.files[i], options.files[i]));
    ASSIGN_OR_RETURN(const LabelImage labels,
                     DecodeLabels(options.files[i + 1], options.files[i + 1]));
    const int width = photo.width, height = photo.height;
    if (labels.width != width || labels.height != height) {
      return absl::InvalidArgumentError("photograph and labels differ in size");
    }
    std::map<uint32_t, BinaryMask> masks;
    for (size_t pixel = 0; pixel < labels.labels.size(); ++pixel) {
      if (labels.labels[pixel] == 0) continue;
      BinaryMask& mask = masks[labels.labels[pixel]];
      mask.pixels.resize(labels.labels.size());
      mask.pixels[pixel] = 1;
    }
    ASSIGN_OR_RETURN(const SamEmbedding embedding, embed.Of([&] { return ours->Embed(photo); }));
    RETURN_IF_ERROR(onnx_embed.Of([&] { return reference->SetPhotograph(photo); }));
    for (const auto& [label, mask] : masks) {
      if (std::ranges::count(mask.pixels, 1) < 400) continue;
      for (const bool grow : {false, true}) {
        const BinaryMask prompt = grow ? GrownBy(mask, width, height, 4) : mask;
        ASSIGN_OR_RETURN(const BinaryMask got,
                         refine.Of([&] { return ours->Refine(embedding, prompt); }));
        ASSIGN_OR_RETURN(const BinaryMask want, onnx_refine.Of([&] {
          return RefineMask(*reference, prompt, width, height);
        }));
        Agreement& agreement = grow ? grown_masks : as_is;
        agreement.ious.push_back(AgreementOf(got, want));
        agreement.moved += 1 - AgreementOf(want, prompt);
      }
    }
  }
  if (as_is.ious.empty()) return absl::InvalidArgumentError("no label has 400 pixels");
  as_is.Print("as they are");
  grown_masks.Print("grown by 4 pixels");
  std::printf("%s: embedding %.3f core s, refining %.3f; ONNX Runtime: %.3f, %.3f\n",
              ours->processor().c_str(), embed.mean(), refine.mean(), onnx_embed.mean(),
              onnx_refine.mean());
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  pepeseg::AgreementOptions options;
  std::vector<std::string> rest;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--cuda") {
      options.cuda = true;
    } else if (word == "--threads" && i + 1 < argc) {
      if (!absl::SimpleAtoi(argv[++i], &options.num_threads)) return 2;
    } else {
      rest.push_back(word);
    }
  }
  if (rest.size() < 3 || rest.size() % 2 == 0) {
    std::printf("usage: %s SAM_FOLDER [--cuda] [--threads N] PHOTO LABELS [PHOTO LABELS ...]\n",
                argv[0]);
    return 2;
  }
  options.sam = rest[0];
  options.files.assign(rest.begin() + 1, rest.end());
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::printf("%s\n", status.ToString().c_str());
  return status.ok() ? 0 : 1;
}
