#include "clients/cpp/border_requests.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>

#include "google/protobuf/util/time_util.h"

namespace pepeseg::client {
namespace {

using Request = v1::SegmentViewsRequest;

constexpr size_t kViewsAtOnce = 8;

std::vector<std::string> TargetViews(const Request::Targets& targets,
                                     const std::vector<v1::View>& views) {
  std::vector<std::string> names;
  if (targets.group() == Request::Targets::GROUP_UNSPECIFIED) {
    std::set<std::string> seen;
    for (const std::string& name : targets.views()) {
      if (seen.insert(name).second) names.push_back(name);
    }
    return names;
  }
  const bool all = targets.group() == Request::Targets::GROUP_ALL;
  for (const v1::View& view : views) {
    if (all || view.held_out()) names.push_back(view.view());
  }
  return names;
}

void AddDuration(const google::protobuf::Duration& more, google::protobuf::Duration& sum) {
  using google::protobuf::util::TimeUtil;
  sum = TimeUtil::NanosecondsToDuration(TimeUtil::DurationToNanoseconds(sum) +
                                        TimeUtil::DurationToNanoseconds(more));
}

}  // namespace

std::vector<Request> PiecesOf(const Request& request, const std::vector<v1::View>& views) {
  const bool is_group = request.targets().group() != Request::Targets::GROUP_UNSPECIFIED;
  if (is_group && !request.targets().views().empty()) return {request};  // the server refuses both
  const std::vector<std::string> names = TargetViews(request.targets(), views);
  if (names.size() <= kViewsAtOnce) return {request};
  std::vector<Request> pieces;
  for (size_t first = 0; first < names.size(); first += kViewsAtOnce) {
    Request& piece = pieces.emplace_back(request);
    piece.clear_targets();
    const size_t end = std::min(first + kViewsAtOnce, names.size());
    for (size_t i = first; i < end; ++i) piece.mutable_targets()->add_views(names[i]);
  }
  return pieces;
}

void AddPiece(const v1::SegmentViewsResponse& piece, v1::SegmentViewsResponse& whole) {
  whole.mutable_masks()->MergeFrom(piece.masks());
  v1::QueryTiming& timing = *whole.mutable_timing();
  AddDuration(piece.timing().queue(), *timing.mutable_queue());
  AddDuration(piece.timing().load(), *timing.mutable_load());
  AddDuration(piece.timing().compute(), *timing.mutable_compute());
  AddDuration(piece.timing().encode(), *timing.mutable_encode());
  if (piece.has_box_agreement()) whole.set_box_agreement(piece.box_agreement());
}

}  // namespace pepeseg::client
