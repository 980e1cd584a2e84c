#include "server/services/detector_words.h"

#include <spdlog/spdlog.h>

#include <cstdint>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"
#include "core/find/word_match.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

constexpr size_t kMostModels = 64;
// The network, the library and their buffers, bytes (tests/bench/results/words.md).
constexpr int64_t kDetectorBytes = int64_t{150} << 20;
// Small things are found in tiles: the scores of desk's fruits and cup double.
constexpr int kTiles = 2;

// Everyday words for words of COCO.
constexpr std::pair<absl::string_view, absl::string_view> kOtherWords[] = {
    {"aeroplane", "airplane"},
    {"bike", "bicycle"},
    {"cellphone", "cell phone"},
    {"doughnut", "donut"},
    {"fridge", "refrigerator"},
    {"hairdryer", "hair drier"},
    {"microwave oven", "microwave"},
    {"mobile phone", "cell phone"},
    {"motorbike", "motorcycle"},
    {"mug", "cup"},
    {"phone", "cell phone"},
    {"plane", "airplane"},
    {"plant", "potted plant"},
    {"rucksack", "backpack"},
    {"sofa", "couch"},
    {"table", "dining table"},
    {"teddy", "teddy bear"},
    {"television", "tv"},
    {"tv set", "tv"},
    {"wineglass", "wine glass"}};

// Returns the words of a text as one (WordsOf), or the word of COCO for it.
std::string PlainWord(absl::string_view text) {
  std::string word = absl::StrJoin(WordsOf(text), " ");
  for (const auto& [other, meant] : kOtherWords) {
    if (word == other) word = std::string(meant);
  }
  return word;
}

// Returns the number of the known word that a text is, or that means the same.
std::optional<int> FindKnownWord(absl::string_view text, const std::vector<std::string>& known) {
  const std::string word = PlainWord(text);
  for (size_t i = 0; i < known.size(); ++i) {
    if (PlainWord(known[i]) == word) return static_cast<int>(i);
  }
  return std::nullopt;
}

}  // namespace

DetectorWords::DetectorWords(const Dependencies& deps)
    : deps_(deps),
      known_(deps.folder.empty()
                 ? std::vector<std::string>()
                 : ReadDetectorWords(deps.folder).value_or(std::vector<std::string>())),
      recent_(kMostModels) {}

// The log has the reason: clients do not learn the server's paths.
absl::Status DetectorWords::OpenDetector() {
  if (detector_ != nullptr) return absl::OkStatus();
  ASSIGN_OR_RETURN(auto memory, deps_.models.TakeServerMemory({kDetectorBytes, 0}));
  auto detector = Detector::Load(deps_.folder, {.num_threads = deps_.num_threads, .tiles = kTiles});
  if (detector.ok()) {
    detector_ = *std::move(detector);
    memory_ = std::move(memory);
    return absl::OkStatus();
  }
  spdlog::error("words: {}", detector.status().ToString());
  if (absl::IsResourceExhausted(detector.status())) {
    return absl::ResourceExhaustedError("the detector does not fit into the server's memory");
  }
  return WithResource(absl::FailedPreconditionError(
                          "the detector of words cannot be loaded: the server's log says why"),
                      "NO_DETECTOR", "detector");
}

absl::StatusOr<const DetectorWords::Words*> DetectorWords::WordsOf(const WordQuery& query,
                                                                   const SceneSegments& scene) {
  const std::string key = absl::StrCat(query.model.id.scene.id, "/", query.model.id.number);
  if (const Words* const kept = recent_.Find(key)) return kept;
  RETURN_IF_ERROR(OpenDetector());
  std::vector<std::vector<Sighting>> sightings;
  for (const SeenView& seen : scene.views) {
    const ModelView& view = query.model->model().views[seen.view];
    ASSIGN_OR_RETURN(const Image image, deps_.photographs.Of(query.model, view, query.check));
    ASSIGN_OR_RETURN(const std::vector<DetectedBox> boxes, detector_->Detect(image));
    const auto width = static_cast<float>(image.width), height = static_cast<float>(image.height);
    std::vector<Sighting>& in_view = sightings.emplace_back();
    for (const DetectedBox& box : boxes) {
      in_view.push_back(
          {box.word, box.score, box.x0 / width, box.y0 / height, box.x1 / width, box.y1 / height});
    }
  }
  return recent_.Keep(key, VoteWords(scene, sightings, static_cast<int>(known_.size())));
}

absl::StatusOr<WordAnswer> DetectorWords::Find(const WordQuery& query) {
  WordAnswer answer;
  answer.known_words = known_;
  const std::optional<int> word = FindKnownWord(query.text, known_);
  if (!word) return answer;
  ASSIGN_OR_RETURN(const std::shared_ptr<const SceneSegments> scene, query.segments());
  const std::lock_guard lock(mutex_);
  ASSIGN_OR_RETURN(const Words* words, WordsOf(query, *scene));
  for (const SegmentWord& thing : ThingsOfWord(*scene, *words, *word)) {
    answer.things.push_back({thing.score, known_[*word], thing.segment, ""});
  }
  return answer;
}

}  // namespace pepeseg
