#include "core/priors/sam/device_sam.h"

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/backend_proposals.h"
#include "core/priors/sam/decoder_layers.h"
#include "core/priors/sam/sam_networks.h"

namespace pepeseg {
namespace {

// Keeps a photograph's embedding on the device.
class DeviceSegmenter : public PromptedSegmenter {
 public:
  explicit DeviceSegmenter(DeviceSam& sam) : sam_(sam) {}

  int extent() const override { return sam_.decoder().extent(); }

  absl::Status SetPhotograph(const Image& photo) override {
    SetSize(photo.width, photo.height);
    ASSIGN_OR_RETURN(embedding_, sam_.Embed(photo));
    return absl::OkStatus();
  }

  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    std::vector<DecoderPoint> points;
    for (const SegmenterPrompt& prompt : prompts) {
      AppendPrompt(prompt, grid_, sam_.decoder(), points);
    }
    return Alone<PromptAnswers>([&] {
      return Answers([&](DecodedMasks& masks) {
        return sam_.decoder().Decode(embedding_.span(), points,
                                     static_cast<int>(points.size() / prompts.size()),
                                     {grid_.width, grid_.height}, true, masks);
      });
    });
  }

  absl::StatusOr<SamEmbedding> Embedding() override {
    return Alone<SamEmbedding>([&]() -> absl::StatusOr<SamEmbedding> {
      return SamEmbedding{width_, height_, embedding_.DownloadHalves()};
    });
  }

  absl::Status SetEmbedding(const SamEmbedding& embedding) override {
    const int64_t size = sam_.encoder().shape().embedding_size();
    if (std::cmp_not_equal(embedding.values.size(), size)) {
      return absl::InvalidArgumentError(
          absl::StrCat("SAM: an embedding has ", embedding.values.size(), " values, not ", size));
    }
    SetSize(embedding.width, embedding.height);
    return sam_.Run([&] {
      if (embedding_.size() != size) {
        embedding_ = NetworkBuffer(sam_.backend(), sam_.decoder().precision(), size);
      }
      if (embedding_.size() == size) embedding_.UploadHalves(embedding.values);
      return ErrorOf(sam_.backend());
    });
  }

  absl::StatusOr<PromptAnswers> SegmentByMask(const MaskPrompt& prompt) override {
    std::vector<DecoderPoint> points;
    AppendPrompt(prompt, grid_, sam_.decoder(), points);
    return Alone<PromptAnswers>([&] {
      return Answers([&](DecodedMasks& masks) {
        if (prompt.logits.empty()) {
          return sam_.decoder().Decode(embedding_.span(), points, static_cast<int>(points.size()),
                                       {grid_.width, grid_.height}, true, masks);
        }
        return sam_.decoder().DecodeWithMask(embedding_.span(), points, prompt.logits,
                                             {grid_.width, grid_.height}, masks);
      });
    });
  }

  absl::StatusOr<Proposals> Propose(const ProposalRequest& request,
                                    absl::FunctionRef<absl::Status()> progress) override {
    RETURN_IF_ERROR(progress());
    return Alone<Proposals>([&] {
      return ProposeOnBackend(sam_.backend(), sam_.decoder(), embedding_.span(), request);
    });
  }

  absl::StatusOr<std::vector<ProposedMask>> Match(
      std::span<const TargetedPrompt> prompts,
      absl::FunctionRef<absl::Status()> progress) override {
    RETURN_IF_ERROR(progress());
    return Alone<std::vector<ProposedMask>>([&] {
      return MatchOnBackend(sam_.backend(), sam_.decoder(), embedding_.span(), grid_, prompts);
    });
  }

  absl::StatusOr<std::vector<std::vector<PixelRun>>> Enlarge(std::span<const ProposedMask> masks,
                                                             const View& view) override {
    return Alone<std::vector<std::vector<PixelRun>>>(
        [&] { return EnlargeOnBackend(sam_.backend(), extent(), masks, view); });
  }

 private:
  // Returns what `calls` returns, computed while no other segmenter computes.
  template <class Result>
  absl::StatusOr<Result> Alone(absl::FunctionRef<absl::StatusOr<Result>()> calls) {
    absl::StatusOr<Result> result = Result();
    const absl::Status status = sam_.Run([&] {
      result = calls();
      return result.status();
    });
    if (!status.ok()) return status;
    return result;
  }

  void SetSize(int width, int height) {
    width_ = width;
    height_ = height;
    grid_ = AnswerGrid(width, height, extent());
  }

  // Returns what `decode` makes, with the cells of each square that show the photograph.
  absl::StatusOr<PromptAnswers> Answers(
      absl::FunctionRef<absl::Status(DecodedMasks& masks)> decode) {
    DecodedMasks masks;
    RETURN_IF_ERROR(decode(masks));
    PromptAnswers answers = grid_;
    answers.ious.resize(static_cast<size_t>(masks.ious.size()));
    masks.ious.Download(answers.ious);
    std::vector<float> squares(static_cast<size_t>(masks.logits.size()));
    masks.logits.Download(squares);
    answers.logits = WithoutPadding(squares, extent(), grid_);
    return answers;
  }

  DeviceSam& sam_;
  int width_ = 0, height_ = 0;  // of the photograph, pixels
  PromptAnswers grid_;          // grid of the photograph, without answers
  NetworkBuffer embedding_;     // [places, channels]
};

}  // namespace

DeviceSam::DeviceSam(std::unique_ptr<Backend> backend, std::unique_ptr<EncoderNetwork> encoder,
                     std::unique_ptr<DecoderNetwork> decoder)
    : backend_(std::move(backend)), encoder_(std::move(encoder)), decoder_(std::move(decoder)) {
  decoder_->EndWhen(&interrupted_);
}
DeviceSam::~DeviceSam() = default;

namespace {

absl::StatusOr<std::unique_ptr<DeviceSam>> OpenOn(std::unique_ptr<Backend> backend,
                                                  const std::filesystem::path& folder,
                                                  Precision precision) {
  ASSIGN_OR_RETURN(auto encoder, EncoderNetwork::Load(folder / kSamEncoder, *backend, precision));
  ASSIGN_OR_RETURN(auto decoder, DecoderNetwork::Load(folder / kSamDecoder, *backend, precision));
  return std::make_unique<DeviceSam>(std::move(backend), std::move(encoder), std::move(decoder));
}

}  // namespace

absl::StatusOr<std::unique_ptr<DeviceSam>> DeviceSam::Open(const std::filesystem::path& folder,
                                                           int cuda_device) {
  std::string error;
  auto backend = MakeCudaBackend({.device = cuda_device}, &error);
  if (backend == nullptr) return absl::UnavailableError(error);
  return OpenOn(std::move(backend), folder, Precision::kHalf);
}

absl::StatusOr<std::unique_ptr<DeviceSam>> DeviceSam::OpenOnCpu(const std::filesystem::path& folder,
                                                                int num_threads) {
  return OpenOn(MakeCpuBackend(num_threads), folder, Precision::kFloat);
}

std::unique_ptr<PromptedSegmenter> DeviceSam::MakeSegmenter() {
  return std::make_unique<DeviceSegmenter>(*this);
}

absl::StatusOr<NetworkBuffer> DeviceSam::Embed(const Image& photo) {
  NetworkBuffer embedding;
  const std::array<const Image*, 1> photos = {&photo};
  RETURN_IF_ERROR(Run([&] { return encoder_->Encode(photos, &embedding); }));
  return embedding;
}

// The backend's error says more than that of `calls`, which has it from there.
absl::Status DeviceSam::Run(absl::FunctionRef<absl::Status()> calls) {
  const std::lock_guard lock(mutex_);
  if (interrupted_) return absl::CancelledError("SAM: interrupted");
  const absl::Status status = calls();
  const BackendError error = backend_->TakeError();
  if (error.what.empty()) return status;
  const std::string what = absl::StrCat("SAM: ", error.what);
  return error.fatal ? absl::InternalError(what) : absl::ResourceExhaustedError(what);
}

}  // namespace pepeseg
