// Compares the decoder of SAM on a backend's kernels with ONNX Runtime's, and times it.
//
//   sam_decoder_bench make SAM REFERENCE PHOTOGRAPH.ppm   runs ONNX Runtime and writes its answers
//   sam_decoder_bench SAM REFERENCE [cpu]             compares and times; on CUDA unless "cpu"
//
// SAM is a folder of deploy/sam.sh. REFERENCE has the photograph's embedding, prompts, IoUs and
// logits, so that the second command needs no ONNX Runtime.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/priors/sam/decoder_network.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_networks.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg {
namespace {

constexpr int kCells = 256 * 256, kMasks = PromptAnswers::kMasks;
constexpr int kPlaces = 64 * 64, kChannels = 256;

// Answers to prompts of the same number of points.
struct Answers {
  std::vector<DecoderPoint> points;
  int num_points = 0;
  std::vector<float> logits, ious;  // [prompts, 4, 256, 256], [prompts, 4]
};
struct Reference {
  std::vector<float> embedding;  // [places, channels]
  Answers one, three;            // points of a prompt, without padding
};

template <class T>
void Write(std::ofstream& file, const std::vector<T>& values) {
  const auto size = static_cast<int64_t>(values.size());
  file.write(reinterpret_cast<const char*>(&size), sizeof(size));
  file.write(reinterpret_cast<const char*>(values.data()), size * sizeof(T));
}
template <class T>
void Read(std::ifstream& file, std::vector<T>& values) {
  int64_t size = 0;
  file.read(reinterpret_cast<char*>(&size), sizeof(size));
  values.resize(size);
  file.read(reinterpret_cast<char*>(values.data()), size * sizeof(T));
}

// The decoder with all masks and any number of prompts, as sam_segmenter.cc changes it.
OnnxGraphEdit Edit() {
  OnnxGraphEdit edit;
  edit.rewired = {{"/Reshape_3_output_0", "image_embeddings"},
                  {"/Reshape_6_output_0", "/Unsqueeze_1_output_0"},
                  {"/Gather_2_output_0", "/Gather_1_output_0"},
                  {"/Add_6_output_0", "onnx::Mul_1919"}};
  edit.inputs = {{"image_embeddings", {1, 256, 64, 64}},
                 {"point_coords", {-1, -1, 2}},
                 {"point_labels", {-1, -1}}};
  edit.outputs = {{kSamMasks, {-1, kMasks, 256, 256}}, {kSamIous, {-1, kMasks}}};
  return edit;
}

absl::Status Ask(const SamNetworks& networks, const OnnxTensor& embedding, Answers& answers) {
  const int64_t prompts = static_cast<int64_t>(answers.points.size()) / answers.num_points;
  std::vector<float> points, labels;
  for (const DecoderPoint& point : answers.points) {
    points.insert(points.end(), {point.x, point.y});
    labels.push_back(static_cast<float>(point.label));
  }
  const std::array<OnnxInput, 3> inputs = {
      OnnxInput{"image_embeddings", embedding.shape, embedding.values},
      OnnxInput{"point_coords", {prompts, answers.num_points, 2}, points},
      OnnxInput{"point_labels", {prompts, answers.num_points}, labels}};
  auto outputs = RunSamDecoder(*networks.decoder, inputs, prompts);
  if (!outputs.ok()) return outputs.status();
  answers.logits = std::move((*outputs)[0].values);
  answers.ious = std::move((*outputs)[1].values);
  return absl::OkStatus();
}

absl::Status Make(const std::string& sam, const std::string& path, const std::string& photo) {
  auto networks = SamNetworks::Open(sam, Edit(), {.num_threads = 2});
  if (!networks.ok()) return networks.status();
  std::ifstream from(photo, std::ios::binary);
  std::string format;
  Image image;
  int largest = 0;
  from >> format >> image.width >> image.height >> largest;
  from.get();
  if (!from || format != "P6" || largest != 255 || image.width > 10000 || image.height > 10000) {
    return absl::InvalidArgumentError(photo + ": not a PPM file (P6, 255)");
  }
  image.channels = 3;
  image.pixels.resize(size_t{3} * image.width * image.height);
  from.read(reinterpret_cast<char*>(image.pixels.data()),
            static_cast<std::streamsize>(image.pixels.size()));
  auto embedding = EmbedPhotograph(*(*networks)->encoder, image);
  if (!embedding.ok()) return embedding.status();
  Reference reference;
  for (int place = 0; place < kPlaces; ++place) {
    for (int c = 0; c < kChannels; ++c) {
      reference.embedding.push_back(embedding->values[static_cast<size_t>(c) * kPlaces + place]);
    }
  }
  reference.one.num_points = 2;
  for (int i = 0; i < 12; ++i) {
    reference.one.points.push_back({100.0F + 230 * (i % 4), 110.0F + 240 * (i / 4), 1});
    reference.one.points.push_back({0, 0, -1});
  }
  reference.three.num_points = 4;
  for (int i = 0; i < 3; ++i) {
    reference.three.points.push_back({200.0F + 200 * i, 300, 1});
    reference.three.points.push_back({230.0F + 200 * i, 340, 1});
    reference.three.points.push_back({400.0F + 200 * i, 500, 0});
    reference.three.points.push_back({0, 0, -1});
  }
  std::ofstream file(path, std::ios::binary);
  Write(file, reference.embedding);
  for (Answers* answers : {&reference.one, &reference.three}) {
    const absl::Status asked = Ask(**networks, *embedding, *answers);
    if (!asked.ok()) return asked;
    Write(file, answers->points);
    Write(file, answers->logits);
    Write(file, answers->ious);
  }
  return file ? absl::OkStatus() : absl::InternalError("cannot write " + path);
}

// Prints how far the backend's answers are from the reference's.
void Compare(const char* name, const Answers& want, const DecodedMasks& got) {
  std::vector<float> logits(want.logits.size()), ious(want.ious.size());
  got.logits.Download(logits);
  got.ious.Download(ious);
  double largest = 0, squares = 0, iou_error = 0, sum_iou = 0, worst = 1;
  int64_t near = 0;
  for (size_t i = 0; i < ious.size(); ++i) {
    iou_error = std::max<double>(iou_error, std::abs(ious[i] - want.ious[i]));
    int64_t common = 0, united = 0;
    for (size_t k = i * kCells; k < (i + 1) * kCells; ++k) {
      const double error = std::abs(logits[k] - want.logits[k]);
      largest = error <= largest ? largest : error;
      if (std::abs(want.logits[k]) < 1) {
        squares += error * error;
        ++near;
      }
      common += logits[k] > 0 && want.logits[k] > 0;
      united += logits[k] > 0 || want.logits[k] > 0;
    }
    const double iou = united == 0 ? 1 : static_cast<double>(common) / united;
    sum_iou += iou;
    worst = std::min(worst, iou);
  }
  std::printf(
      "%s: logits max %.2e, rms near 0 %.2e; IoU estimate max %.1e; mask IoU mean %.5f, "
      "least %.4f\n",
      name, largest, std::sqrt(squares / std::max<int64_t>(near, 1)), iou_error,
      sum_iou / ious.size(), worst);
}

void Time(Backend& backend, DecoderNetwork& decoder, ConstNetworkSpan embedding, int num_prompts,
          DecodedMasks& masks) {
  std::vector<DecoderPoint> points;
  for (int i = 0; i < num_prompts; ++i) {
    points.push_back({20.0F + i * 13 % 1000, 15.0F + i * 29 % 700, 1});
    points.push_back({0, 0, -1});
  }
  double best = 1e9;
  for (int run = 0; run < 6; ++run) {
    backend.Sync();
    const double start = NowMs();
    const absl::Status status = decoder.Decode(embedding, points, 2, {256, 192}, false, masks);
    backend.Sync();
    if (!status.ok()) std::printf("%s\n", std::string(status.message()).c_str());
    best = std::min(best, NowMs() - start);
  }
  std::printf("%d prompts: %.3f ms, %.0f MiB on the device\n", num_prompts, best,
              static_cast<double>(backend.peak_bytes_in_use()) / (1 << 20));
}

// Prints the core milliseconds of a prompt, in calls of four as SegmentPhotograph makes them.
void TimeOnCores(DecoderNetwork& decoder, ConstNetworkSpan embedding, DecodedMasks& masks) {
  constexpr int kCalls = 12, kPrompts = 4;
  std::vector<DecoderPoint> points;
  for (int i = 0; i < kPrompts; ++i) points.insert(points.end(), {{150.0F + 200 * i, 300, 1}, {}});
  const double start = CoreNow();
  for (int call = 0; call < kCalls; ++call) {
    const absl::Status status = decoder.Decode(embedding, points, 2, {256, 192}, true, masks);
    if (!status.ok()) std::printf("%s\n", std::string(status.message()).c_str());
  }
  std::printf("%.1f core ms per prompt\n", 1e3 * (CoreNow() - start) / (kCalls * kPrompts));
}

absl::Status Run(const std::string& sam, const std::string& path, bool cpu) {
  std::ifstream file(path, std::ios::binary);
  Reference reference;
  Read(file, reference.embedding);
  reference.one.num_points = 2;
  reference.three.num_points = 4;
  for (Answers* answers : {&reference.one, &reference.three}) {
    Read(file, answers->points);
    Read(file, answers->logits);
    Read(file, answers->ious);
  }
  if (!file) return absl::InvalidArgumentError("cannot read " + path);
  for (const bool timed : {false, true}) {
    std::vector<KernelTime> times;
    std::string error;
    auto backend = cpu ? MakeCpuBackend()
                       : MakeCudaBackend({.kernel_times = timed ? &times : nullptr}, &error);
    if (backend == nullptr) return absl::UnavailableError(error);
    std::printf("%s%s\n", backend->name().c_str(), timed ? ", kernels timed" : "");
    const Precision precision = cpu ? Precision::kFloat : Precision::kHalf;
    auto decoder = DecoderNetwork::Load(sam + "/sam.onnx", *backend, precision);
    if (!decoder.ok()) return decoder.status();
    const NetworkBuffer embedding(*backend, precision, std::span<const float>(reference.embedding));
    DecodedMasks masks;
    for (const Answers* answers : {&reference.one, &reference.three}) {
      const absl::Status decoded = (*decoder)->Decode(embedding.span(), answers->points,
                                                      answers->num_points, {256, 256}, true, masks);
      if (!decoded.ok()) return decoded;
      Compare(answers->num_points == 2 ? "one point" : "three points", *answers, masks);
    }
    if (cpu) {
      TimeOnCores(**decoder, embedding.span(), masks);
      break;
    }
    backend->Sync();
    times.clear();
    for (const int num_prompts : timed ? std::vector{256} : std::vector{1, 144, 256, 1024}) {
      Time(*backend, **decoder, embedding.span(), num_prompts, masks);
    }
    for (const KernelTime& time : times) {
      std::printf("  %-20s %8.3f ms per run, %d launches\n", time.name.c_str(), time.ms / 6,
                  static_cast<int>(time.calls / 6));
    }
    if (!backend->error().empty()) return absl::InternalError(backend->error());
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  const std::vector<std::string> args(argv + 1, argv + argc);
  absl::Status status =
      absl::InvalidArgumentError("see the top of tests/bench/sam_decoder_bench.cc");
  if (args.size() == 4 && args[0] == "make") {
    status = pepeseg::Make(args[1], args[2], args[3]);
  } else if (args.size() == 2 || args.size() == 3) {
    status = pepeseg::Run(args[0], args[1], args.size() == 3 && args[2] == "cpu");
  }
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.ToString().c_str());
  return status.ok() ? 0 : 1;
}
