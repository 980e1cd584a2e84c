#include "server/services/edit_model.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_version.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/services/model_versions.h"

namespace pepeseg {
namespace {

constexpr double kMinScale = 0.001, kMaxScale = 1000;
constexpr double kMaxNormError = 1e-3;  // of a quaternion
constexpr absl::Duration kProgressEvery = absl::Milliseconds(200);

bool IsFinite(const v1::Vector3& v) {
  return std::isfinite(v.x()) && std::isfinite(v.y()) && std::isfinite(v.z());
}

absl::Status CheckVector(const v1::Vector3& v, const std::string& field) {
  if (IsFinite(v)) return absl::OkStatus();
  return BadField(field, absl::StrCat(v.x(), ",", v.y(), ",", v.z()), "must be finite");
}

absl::Status CheckMove(const v1::EditModelRequest::Move& move) {
  RETURN_IF_ERROR(CheckVector(move.translation(), "move.translation"));
  RETURN_IF_ERROR(CheckVector(move.pivot(), "move.pivot"));
  const double scale = move.scale();
  if (scale != 0 && !(scale >= kMinScale && scale <= kMaxScale)) {
    return BadField("move.scale", absl::StrCat(scale),
                    absl::StrCat("allowed are ", kMinScale, "..", kMaxScale));
  }
  if (!move.has_rotation()) return absl::OkStatus();
  const v1::Quaternion& q = move.rotation();
  const double norm = std::sqrt(q.w() * q.w() + q.x() * q.x() + q.y() * q.y() + q.z() * q.z());
  if (std::abs(norm - 1) <= kMaxNormError) return absl::OkStatus();
  return BadField("move.rotation", absl::StrCat(norm), "is the norm of the quaternion; must be 1");
}

absl::Status CheckRecolor(const v1::EditModelRequest::Recolor& recolor) {
  const auto check = [](double value, const char* field) -> absl::Status {
    if (value >= 0 && value <= 1) return absl::OkStatus();
    return BadField(absl::StrCat("recolor.", field), absl::StrCat(value), "allowed are 0..1");
  };
  RETURN_IF_ERROR(check(recolor.red(), "red"));
  RETURN_IF_ERROR(check(recolor.green(), "green"));
  RETURN_IF_ERROR(check(recolor.blue(), "blue"));
  return check(recolor.strength(), "strength");
}

absl::Status CheckEdit(const v1::EditModelRequest& request) {
  switch (request.edit_case()) {
    case v1::EditModelRequest::kRemove:
      if (!request.remove().fill() || !request.subset().complement()) return absl::OkStatus();
      return BadField("remove.fill", "true", "fills no hole around a complement");
    case v1::EditModelRequest::kMove:
      return CheckMove(request.move());
    case v1::EditModelRequest::kRecolor:
      return CheckRecolor(request.recolor());
    default:
      return BadField("edit", "", "one of remove, move and recolor is required");
  }
}

// Returns the middle of the box of a set, which must not be empty.
Eigen::Vector3d MiddleOf(const Model& model, const GaussianSet& set) {
  const SetBounds bounds = BoundsOf(model.gaussians, set);
  return (bounds.min.cast<double>() + bounds.max.cast<double>()) / 2;
}

Eigen::Vector3d VectorOf(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

Similarity SimilarityOf(const v1::EditModelRequest::Move& move, const Model& model,
                        const GaussianSet& subset) {
  Similarity similarity;
  if (move.scale() != 0) similarity.scale = move.scale();
  if (move.has_rotation()) {
    const v1::Quaternion& q = move.rotation();
    similarity.rotation = Eigen::Quaterniond(q.w(), q.x(), q.y(), q.z()).normalized();
  }
  similarity.translation = VectorOf(move.translation());
  similarity.pivot =
      move.has_pivot() ? VectorOf(move.pivot()) - model.origin : MiddleOf(model, subset);
  return similarity;
}

NewColor ColorOf(const v1::EditModelRequest::Recolor& recolor) {
  return {{recolor.red(), recolor.green(), recolor.blue()},
          recolor.strength() == 0 ? 1 : recolor.strength()};
}

// Refuses a move whose result cannot be rendered.
absl::StatusOr<EditedModel> Moved(const Model& model, const GaussianSet& subset,
                                  const v1::EditModelRequest::Move& move) {
  EditedModel edited = MoveMembers(model, subset, SimilarityOf(move, model, subset), move.copy());
  const double reach = ReachOf(edited.gaussians, edited.touched);
  if (reach <= kMaxMovedReach) return edited;
  return BadField("move", absl::StrCat(reach),
                  absl::StrCat("scene units would be a coordinate or the size of a Gaussian; "
                               "allowed are ",
                               kMaxMovedReach));
}

// Returns what an edit did, for people.
std::string TextOf(const v1::EditModelRequest& request, const EditedModel& edited) {
  if (request.has_recolor()) return absl::StrCat("recoloured ", edited.num_changed, " Gaussians");
  if (request.has_move() && request.move().copy()) {
    return absl::StrCat("copied ", edited.num_added, " Gaussians");
  }
  if (request.has_move()) return absl::StrCat("moved ", edited.num_changed, " Gaussians");
  const std::string removed = absl::StrCat("removed ", edited.num_removed, " Gaussians");
  return request.remove().fill() ? absl::StrCat(removed, " and filled the hole") : removed;
}

}  // namespace

EditModelStream::EditModelStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                                 const v1::EditModelRequest& request)
    : WriteStream(&deps.runner.streams(), &deps.runner.pools().correction),
      deps_(deps),
      call_(call),
      origin_(OriginOf(*call)),
      request_(request) {}

absl::Status EditModelStream::Open() {
  ASSIGN_OR_RETURN(caller_, deps_.runner.authorizer().Authorize(origin_, request_));
  begun_ = deps_.runner.authorizer().Begin(origin_, *caller_, request_);
  RETURN_IF_ERROR(Admit(OwnerOf(*caller_, origin_)));
  RETURN_IF_ERROR(deps_.runner.quotas().Admit(caller_->project, request_));
  RETURN_IF_ERROR(CheckEdit(request_));
  *timing_.mutable_queue() = ToProto(stopwatch_.Lap());
  ASSIGN_OR_RETURN(model_, deps_.models.Load(caller_->scenes, request_.model(), "model"));
  *timing_.mutable_load() = ToProto(stopwatch_.Lap());
  ASSIGN_OR_RETURN(
      std::optional<GaussianSet> subset,
      deps_.selections.FindSubset(caller_->scenes, model_, request_.subset(), "subset"));
  if (!subset) return BadField("subset", "", "is required");
  const int64_t num = subset->count(), all = model_->model().gaussians.count;
  if (num == 0) return BadField("subset", "0", "Gaussians to edit; at least one is needed");
  if (request_.has_remove() && num == all) {
    return BadField("subset", absl::StrCat(num), "Gaussians are all of the model; some must stay");
  }
  if (request_.move().copy() && all + num > kMaxEditedGaussians) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the model would have ", all + num, " Gaussians; allowed are ", kMaxEditedGaussians));
  }
  const bool fills = request_.remove().fill();
  const int64_t bytes = fills ? BytesOfFill(model_->model()) : BytesOfEdit(model_->model());
  ASSIGN_OR_RETURN(memory_, deps_.models.TakeAnswerMemory(model_.id.scene.project, bytes));
  if (!fills) {
    ASSIGN_OR_RETURN(EditedModel edited, Edit(*subset));
    return Store(std::move(edited));
  }
  ASSIGN_OR_RETURN(fill_, HoleFill::Create(model_->segmenter(), *std::move(subset)));
  return absl::OkStatus();
}

absl::StatusOr<EditedModel> EditModelStream::Edit(const GaussianSet& subset) const {
  const Model& model = model_->model();
  if (request_.has_remove()) {
    return RemoveGaussians(model, subset, {Gaussians::Zero(0, model.gaussians.sh_degree), {}});
  }
  if (request_.has_move()) return Moved(model, subset, request_.move());
  return RecolorMembers(model, subset, ColorOf(request_.recolor()));
}

absl::Status EditModelStream::Store(EditedModel edited) {
  *timing_.mutable_compute() = ToProto(stopwatch_.Lap());
  const Model& from_model = model_->model();
  Model model;
  model.gaussians = std::move(edited.gaussians);
  model.field = std::move(edited.field);
  model.views = from_model.views;
  for (ModelView& view : model.views) view.scores.reset();
  model.origin = from_model.origin;
  model.scene_radius = from_model.scene_radius;
  model.facts = from_model.facts;
  model.facts[kEditedFrom] = model_.name;
  ASSIGN_OR_RETURN(const ModelRecord from, deps_.models.Find(model_.id));
  ModelRecord made = from;
  made.metrics = "{}";
  made.num_gaussians = model.gaussians.count;
  made.edit = TextOf(request_, edited);
  ASSIGN_OR_RETURN(made, StoreVersion(deps_.models, from, made,
                                      [&](const auto& /*from*/, const std::filesystem::path& to) {
                                        return WriteEditedModel(to, model);
                                      }));
  v1::EditModelResponse::Result& result = *message_.mutable_result();
  result.set_model(ChildName(made.scene, "models", made.number));
  result.set_edited_from(model_.name);
  result.set_num_removed(edited.num_removed);
  result.set_num_added(edited.num_added);
  result.set_num_changed(edited.num_changed);
  spdlog::info("{}: made from {}: {}", result.model(), model_.name, made.edit);
  if (edited.touched.count() > 0) {
    SelectionRecord selection;
    selection.scene = made.scene;
    // The next query would load the model anyway. The model is made: an error here only costs the
    // selection.
    const auto record = [&]() -> absl::Status {
      ASSIGN_OR_RETURN(const ResidentModel loaded, deps_.models.Load({made.scene, made.number}));
      ASSIGN_OR_RETURN(selection, deps_.selections.Record(loaded, edited.touched, selection));
      result.set_selection(ChildName(made.scene, "selections", selection.number));
      return absl::OkStatus();
    };
    if (const absl::Status status = record(); !status.ok()) {
      spdlog::warn("{}: no selection of what was edited: {}", result.model(), status.ToString());
    }
  }
  *timing_.mutable_encode() = ToProto(stopwatch_.Lap());
  *result.mutable_timing() = timing_;
  answered_ = true;
  return absl::OkStatus();
}

absl::Status EditModelStream::RecordEnd(absl::Status status) {
  if (!begun_.empty()) {
    deps_.runner.authorizer().Record(origin_, *caller_, request_, status,
                                     std::exchange(begun_, {}));
  }
  return status;
}

void EditModelStream::OnClosed() {
  if (begun_.empty()) return;
  deps_.runner.pools().correction.SubmitAlways(
      caller_->project, [deps = deps_, origin = origin_, caller = *caller_, request = request_,
                         begun = std::move(begun_), answered = answered_] {
        const absl::Status status =
            answered ? absl::OkStatus() : absl::CancelledError("the client is gone");
        deps.runner.authorizer().Record(origin, caller, request, status, begun);
      });
}

Stream::Step EditModelStream::Work(bool) {
  if (answered_) return End(absl::OkStatus());
  absl::Status status = !caller_        ? Open()
                        : cancelled()   ? absl::CancelledError("nobody waits for the edit")
                        : fill_->done() ? Store(fill_->Take())
                                        : fill_->Next();
  if (!status.ok()) return End(std::move(status));
  if (answered_) return {Next::kIo, absl::OkStatus()};
  if (const absl::Time now = absl::Now(); now - last_progress_ >= kProgressEvery) {
    last_progress_ = now;
    const HoleFill::Progress progress = fill_->progress();
    message_.mutable_progress()->set_activity(progress.activity);
    message_.mutable_progress()->set_num_done(progress.num_done);
    message_.mutable_progress()->set_num_all(progress.num_all);
    return {Next::kIo, absl::OkStatus()};
  }
  Wake();  // again, after what waits for the pool
  return {Next::kIdle, absl::OkStatus()};
}

}  // namespace pepeseg
