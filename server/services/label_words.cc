#include "server/services/label_words.h"

#include <algorithm>
#include <string>
#include <variant>
#include <vector>

#include "core/base/status_macros.h"
#include "core/find/word_match.h"
#include "server/api/resource_name.h"
#include "server/api/segment_request.h"

namespace pepeseg {
namespace {

// IoU of the label's mask and the segment in the view of the label.
constexpr double kMinLabelIou = 0.5;

// Returns all labels of a scene.
absl::StatusOr<std::vector<LabelRecord>> AllLabels(Store& store, const SceneRef& scene) {
  std::vector<LabelRecord> labels;
  PageRequest page;
  page.page_size = 1000;
  do {
    ASSIGN_OR_RETURN(Page<LabelRecord> part, store.labels().ListLabels(scene, page));
    labels.insert(labels.end(), part.records.begin(), part.records.end());
    page.page_token = part.next_page_token;
  } while (!page.page_token.empty());
  return labels;
}

// Returns the segment that is like a label's mask, or -1.
absl::StatusOr<int32_t> SegmentOf(const WordQuery& query, const Prompt& label) {
  RETURN_IF_ERROR(query.check());
  ASSIGN_OR_RETURN(const auto segments, query.segments());
  ASSIGN_OR_RETURN(const SeenView seen, SeeViewOf(*query.model, *segments, label.view));
  const BinaryMask mask =
      Resized(std::get<BinaryMask>(label.what), {label.view.camera.width, label.view.camera.height},
              {seen.width, seen.height});
  return SegmentLike(seen, mask.pixels, kMinLabelIou);
}

}  // namespace

absl::StatusOr<WordAnswer> LabelWords::Find(const WordQuery& query) {
  const auto synonyms_of = [this](const std::string& noun) {
    return wordnet_ == nullptr ? std::vector<std::string>() : wordnet_->SynonymsOf(noun);
  };
  WordAnswer answer;
  ASSIGN_OR_RETURN(const auto labels, AllLabels(store_, query.model.id.scene));
  for (const LabelRecord& label : labels) {
    answer.known_words.push_back(label.text);
    const double score = std::max(NameScore(query.text, label.text, synonyms_of),
                                  NameScore(query.text, label.id, synonyms_of));
    if (score <= 0) continue;
    const auto prompt = PromptOfLabel(label, query.model->model(), query.model.id);
    if (!prompt.ok()) continue;
    ASSIGN_OR_RETURN(const int32_t segment, SegmentOf(query, *prompt));
    answer.things.push_back({score, label.text, segment, LabelName(label.scene, label.id)});
  }
  return answer;
}

}  // namespace pepeseg
