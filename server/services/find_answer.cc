#include "server/services/find_answer.h"

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/find/word_match.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"
#include "server/services/found_to_proto.h"

namespace pepeseg {
namespace {

constexpr int kMaxTextCharacters = 200;
constexpr int kMaxResults = 200, kDefaultResults = 100;
constexpr int kMaxKnownWords = 1000;
constexpr size_t kMostSuggested = 5;
// Of `like`: chosen on crowded, desk and bolts (tests/bench/results/all_alike.md).
constexpr double kMinLikeScore = 0.2;
// IoU of the prompt's mask and the segment that it means.
constexpr double kMinLikeIou = 0.5;

using Found = v1::FindSegmentsResponse::Found;

absl::Status CheckText(const std::string& text) {
  if (Utf8Prefix(text, text.size()) != text) return BadField("text", text, "not UTF-8");
  // Bytes 10xxxxxx continue a character.
  const auto count = std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; });
  if (absl::StripAsciiWhitespace(text).empty()) return BadField("text", text, "is empty");
  if (count <= kMaxTextCharacters) return absl::OkStatus();
  return BadField("text", absl::StrCat(count),
                  absl::StrCat("characters; allowed are ", kMaxTextCharacters));
}

absl::Status CheckRequest(const v1::FindSegmentsRequest& request) {
  if (request.what_case() == v1::FindSegmentsRequest::WHAT_NOT_SET) {
    return BadField("text", "", "neither a text nor a thing to be like");
  }
  if (request.what_case() == v1::FindSegmentsRequest::kText) {
    RETURN_IF_ERROR(CheckText(request.text()));
  }
  if (request.max_results() < 0 || request.max_results() > kMaxResults) {
    return BadField("max_results", absl::StrCat(request.max_results()),
                    absl::StrCat("not in [0, ", kMaxResults, "]"));
  }
  if (request.has_min_score() && !(request.min_score() >= 0 && request.min_score() <= 1)) {
    return BadField("min_score", absl::StrCat(request.min_score()), "not in [0, 1]");
  }
  return CheckFrame(request.frame());
}

size_t MaxResults(const v1::FindSegmentsRequest& request) {
  return static_cast<size_t>(request.max_results() > 0 ? request.max_results() : kDefaultResults);
}

// Returns the things of at least a score, the best first, at most `max`. Of those that are no
// label's, no two share Gaussians.
std::vector<WordAnswer::Thing> BestThings(std::vector<WordAnswer::Thing> things, double min_score,
                                          size_t max, const SceneSegments* all) {
  std::ranges::stable_sort(things, std::ranges::greater(), &WordAnswer::Thing::score);
  std::vector<WordAnswer::Thing> best;
  for (WordAnswer::Thing& thing : things) {
    if (best.size() >= max || thing.score < min_score) break;
    const bool shared =
        thing.label.empty() && std::ranges::any_of(best, [&](const WordAnswer::Thing& other) {
          return other.segment >= 0 && thing.segment >= 0 &&
                 all->OverlapOf(other.segment, thing.segment) > 0;
        });
    if (!shared) best.push_back(std::move(thing));
  }
  return best;
}

// Collects what is said where no source has found anything.
void AddUnsure(const WordAnswer& answer, std::set<std::string>& known,
               v1::FindSegmentsResponse* response) {
  known.insert(answer.known_words.begin(), answer.known_words.end());
  for (const WordAnswer::Thing& thing : answer.things) {
    if (thing.score <= response->best_score()) continue;
    response->set_best_score(thing.score);
    response->set_best_word(thing.word);
  }
}

void AddKnownWords(const std::string& text, const std::set<std::string>& known,
                   v1::FindSegmentsResponse* response) {
  const std::vector<std::string> words(known.begin(), known.end());
  for (std::string& word : AlmostSpelt(text, words, kMostSuggested)) {
    response->add_did_you_mean(std::move(word));
  }
  for (const std::string& word : words) {
    if (response->known_words_size() < kMaxKnownWords) response->add_known_words(word);
  }
}

// Returns the number of the segment that a request means. scales: those of its decomposition.
absl::StatusOr<int32_t> NumberOfSegment(const SceneSegments& all, const v1::SegmentRef& segment,
                                        std::span<const double> scales) {
  const bool has_pieces = std::ranges::equal(scales, kPieceDecompositionScales);
  if (!has_pieces && !std::ranges::equal(scales, kDefaultDecompositionScales)) {
    return BadField("like_segment.scales", "",
                    "only the default scales, and 0 and these, are looked at");
  }
  // The default levels are those after the pieces.
  const int level = has_pieces || segment.level() < 0 ? segment.level() : segment.level() + 1;
  const int32_t number = all.NumberOf({level, segment.id()});
  if (number >= 0) return number;
  return BadField("like_segment.id", absl::StrCat(segment.id()),
                  absl::StrCat("no segment of level ", segment.level()));
}

// Returns the mask of a prompt in its view.
absl::StatusOr<BinaryMask> MaskOfPrompt(const SceneModel& model, const Prompt& prompt,
                                        const Granularity& granularity, const WantedCheck& check) {
  if (const auto* const mask = std::get_if<BinaryMask>(&prompt.what)) return *mask;
  SegmentRequest request;
  request.prompt = prompt;
  request.granularity = granularity;
  request.targets = {prompt.view};
  request.frame = FrameKind::kView;
  ASSIGN_OR_RETURN(SegmentedViews views, model.Segment(std::move(request), check));
  ASSIGN_OR_RETURN(SegmentResult result, views.Next());
  if (result.area == 0) return NothingThereError("the model shows nothing there");
  return std::move(result.mask);
}

}  // namespace

absl::Status FindAnswers::FindText(const UnaryCall& call, const ResidentModel& model,
                                   const v1::FindSegmentsRequest& request,
                                   v1::FindSegmentsResponse* response) {
  const WantedCheck check = [&] { return call.CheckWanted(); };
  std::shared_ptr<const SceneSegments> all;
  const WordQuery query = {model, std::string(absl::StripAsciiWhitespace(request.text())),
                           [&]() -> absl::StatusOr<std::shared_ptr<const SceneSegments>> {
                             if (all == nullptr) {
                               ASSIGN_OR_RETURN(all, seen_.Segments(model, check));
                             }
                             return all;
                           },
                           check};
  std::set<std::string> known;
  for (WordSource* const source : words_) {
    ASSIGN_OR_RETURN(WordAnswer answer, source->Find(query));
    AddUnsure(answer, known, response);
    const double min_score = request.has_min_score() ? request.min_score() : source->min_score();
    const auto things =
        BestThings(std::move(answer.things), min_score, MaxResults(request), all.get());
    if (things.empty()) continue;
    response->clear_best_score();
    response->clear_best_word();
    response->set_source(source->source());
    ASSIGN_OR_RETURN(all, query.segments());
    FoundWriter writer(model->model(), *all, FrameKindFromProto(request.frame()));
    for (const WordAnswer::Thing& thing : things) {
      Found& found = *response->add_found();
      found.set_score(thing.score);
      found.set_word(thing.word);
      found.set_label(thing.label);
      if (!thing.label.empty()) found.mutable_prompt()->set_label(thing.label);
      if (thing.segment >= 0) writer.Write(thing.segment, found);
    }
    return absl::OkStatus();
  }
  AddKnownWords(query.text, known, response);
  return absl::OkStatus();
}

absl::StatusOr<LookedFor> FindAnswers::ReadLike(const UnaryCall& call, const ResidentModel& model,
                                                const SceneSegments& all, ImageEncoder& encoder,
                                                const v1::FindSegmentsRequest& request) const {
  const WantedCheck check = [&] { return call.CheckWanted(); };
  const SegmentRequestReader reader(model->model(), model.id, models_.store());
  const auto image_of = [&](const ModelView& view) {
    return Frame(view, FrameKindFromProto(request.frame()));
  };
  ASSIGN_OR_RETURN(const Prompt prompt, reader.ReadPrompt(request.like(), image_of, "like"));
  ASSIGN_OR_RETURN(const Granularity granularity,
                   reader.ReadGranularity(request.granularity(), "granularity"));
  const auto mask = MaskOfPrompt(*model, prompt, granularity, check);
  RETURN_IF_ERROR(AtField(mask.status(), "like"));
  ASSIGN_OR_RETURN(const SeenView seen, SeeViewOf(*model, all, prompt.view));
  const Camera& camera = prompt.view.camera;
  const BinaryMask on_grid =
      Resized(*mask, {camera.width, camera.height}, {seen.width, seen.height});
  LookedFor looked_for = {SegmentLike(seen, on_grid.pixels, kMinLikeIou), {}};
  if (looked_for.segment >= 0) return looked_for;
  ASSIGN_OR_RETURN(const ImageFeatures features,
                   encoder.Encode(prompt.view, seen.width, seen.height, check));
  looked_for.features = MeanFeatures(features, on_grid.pixels);
  if (!looked_for.features.empty()) return looked_for;
  return BadField("like", "", "means less than a pixel of a grid of 40,000 pixels over the view");
}

absl::Status FindAnswers::FindLike(const UnaryCall& call, const ResidentModel& model,
                                   const v1::FindSegmentsRequest& request,
                                   v1::FindSegmentsResponse* response) {
  const WantedCheck check = [&] { return call.CheckWanted(); };
  ASSIGN_OR_RETURN(const auto all, seen_.Segments(model, check));
  const std::unique_ptr<ImageEncoder> encoder = images_.EncoderOf(model);
  LookedFor looked_for;
  if (request.what_case() == v1::FindSegmentsRequest::kLike) {
    ASSIGN_OR_RETURN(looked_for, ReadLike(call, model, *all, *encoder, request));
  } else {
    const v1::SegmentRef& segment = request.like_segment();
    ASSIGN_OR_RETURN(const std::vector<double> scales,
                     ReadScales(segment.scales(), "like_segment.scales"));
    ASSIGN_OR_RETURN(looked_for.segment, NumberOfSegment(*all, segment, scales));
  }
  ASSIGN_OR_RETURN(const auto looks, seen_.Looks(model, *encoder, check));
  const std::vector<double> scores = looks->ScoresLike(looked_for);
  const double min_score = request.has_min_score() ? request.min_score() : kMinLikeScore;
  FoundWriter writer(model->model(), *all, FrameKindFromProto(request.frame()));
  for (const int32_t segment : BestApart(*all, scores, min_score, MaxResults(request))) {
    Found& found = *response->add_found();
    found.set_score(scores[segment]);
    writer.Write(segment, found);
  }
  if (!response->found().empty()) {
    response->set_source(v1::FindSegmentsResponse::SOURCE_APPEARANCE);
  } else if (!scores.empty()) {
    response->set_best_score(std::ranges::max(scores));
  }
  return absl::OkStatus();
}

absl::Status FindAnswers::Find(const UnaryCall& call, const v1::FindSegmentsRequest& request,
                               v1::FindSegmentsResponse* response) {
  RETURN_IF_ERROR(CheckRequest(request));
  const bool by_text = request.what_case() == v1::FindSegmentsRequest::kText;
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   models_.LoadWithFeatures(call.scenes(), request.model(), "model"));
  if (!by_text) RETURN_IF_ERROR(images_.CheckAvailable("find by text instead"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(call.CheckWanted());
  RETURN_IF_ERROR(by_text ? FindText(call, model, request, response)
                          : FindLike(call, model, request, response));
  *timing.mutable_compute() = ToProto(stopwatch.Lap());
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
