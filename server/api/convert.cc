#include "server/api/convert.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/train/settings/training_settings.h"

// The fields of v1::TrainingOptions have the names that core gives its options: they are found by
// reflection, and read and set as text, as `advanced` is.
namespace pepeseg {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::TextFormat;

// Maximum size of a name and of a value in `advanced`: a number, a word, or a photograph's name.
constexpr size_t kMaxOptionBytes = 1024;

// Returns what the names of an enum's values begin with: "SFM_MATCHING_".
std::string PrefixOf(const google::protobuf::EnumDescriptor& type) {
  return std::string(absl::StripSuffix(type.value(0)->name(), "UNSPECIFIED"));
}

// Returns the values of a field as core's options take them: numbers, "true", and the words of
// enums, which are their names in lower case without the prefix. Empty: the field is absent or
// UNSPECIFIED.
std::vector<std::string> TextsOf(const Message& message, const FieldDescriptor& field) {
  const auto& reflection = *message.GetReflection();
  std::vector<std::string> texts;
  if (field.is_repeated()) {  // only lists of text
    for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
      texts.push_back(reflection.GetRepeatedString(message, &field, i));
    }
    return texts;
  }
  if (!reflection.HasField(message, &field)) return texts;
  std::string& text = texts.emplace_back();
  TextFormat::PrintFieldValueToString(message, &field, -1, &text);
  if (field.enum_type() == nullptr) return texts;
  if (reflection.GetEnumValue(message, &field) == 0) return {};
  text = absl::AsciiStrToLower(absl::StripPrefix(text, PrefixOf(*field.enum_type())));
  return texts;
}

// Sets the options that have a field in `message`, which the names of all of them begin with:
// "import.".
absl::Status SetFields(const Message& message, const std::string& prefix,
                       TrainingSettings& settings) {
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *message.GetDescriptor()->field(i);
    for (const std::string& text : TextsOf(message, field)) {
      RETURN_IF_ERROR(SetByName(settings, prefix + field.name(), text));
    }
  }
  return absl::OkStatus();
}

absl::Status SetAll(const v1::TrainingOptions& proto, TrainingSettings& settings) {
  const auto& reflection = *proto.GetReflection();
  for (int i = 0; i < proto.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *proto.GetDescriptor()->field(i);
    if (field.message_type() == nullptr || field.is_repeated()) continue;
    RETURN_IF_ERROR(SetFields(reflection.GetMessage(proto, &field), field.name() + ".", settings));
  }
  // In an order that does not depend on how the map is stored.
  const std::map<std::string, std::string> advanced(proto.advanced().begin(),
                                                    proto.advanced().end());
  for (const auto& [name, text] : advanced) {
    if (const size_t size = std::max(name.size(), text.size()); size > kMaxOptionBytes) {
      return absl::InvalidArgumentError(absl::StrCat("advanced: ", name.substr(0, 64), ": ", size,
                                                     " bytes exceed the limit of ",
                                                     kMaxOptionBytes));
    }
    RETURN_IF_ERROR(WithPrefix("advanced: ", SetByName(settings, name, text)));
  }
  return absl::OkStatus();
}

// Sets a field from the text of core's option. A word that the enum lacks is one for UNSPECIFIED.
void SetField(const Option& option, const FieldDescriptor& field, Message& message) {
  if (const auto* list = std::get_if<NamesField>(&option.field)) {
    for (const std::string& name : *list->names) {
      message.GetReflection()->AddString(&message, &field, name);
    }
    return;
  }
  std::string text = TextOf(option).value;
  if (const auto* type = field.enum_type()) {
    const auto* value =
        type->FindValueByName(absl::StrCat(PrefixOf(*type), absl::AsciiStrToUpper(text)));
    text = value == nullptr ? type->value(0)->name() : value->name();
  }
  TextFormat::ParseFieldValueFromString(text, &field, &message);
}

}  // namespace

absl::StatusOr<TrainingSettings> TrainingSettingsFromProto(const v1::TrainingOptions& proto) {
  TrainingSettings settings;
  // UNSPECIFIED means the default, as if the field were absent.
  if (proto.preset() != v1::TRAINING_PRESET_UNSPECIFIED) {
    settings.preset = static_cast<Preset>(proto.preset());
  }
  // The preset comes first, so that options that are given override it.
  Apply(settings.preset, settings.reconstruct, settings.features);
  RETURN_IF_ERROR(WithPrefix("options.", SetAll(proto, settings)));
  RETURN_IF_ERROR(WithPrefix("options.", Validate(settings)));
  return settings;
}

v1::TrainingOptions ToProto(const TrainingSettings& settings) {
  v1::TrainingOptions proto;
  proto.set_preset(static_cast<v1::TrainingPreset>(settings.preset));
  TrainingSettings copy = settings;  // rows point to members that can be set
  VisitOptions(copy, [&](const Option& option) {
    const std::pair<std::string, std::string> name = absl::StrSplit(option.name, '.');
    const FieldDescriptor* part = proto.GetDescriptor()->FindFieldByName(name.first);
    const FieldDescriptor* field = part->message_type()->FindFieldByName(name.second);
    if (field == nullptr) {
      (*proto.mutable_advanced())[option.name] = TextOf(option).value;
    } else {
      SetField(option, *field, *proto.GetReflection()->MutableMessage(&proto, part));
    }
  });
  return proto;
}

absl::StatusOr<FileKind> FileKindFromProto(v1::FileKind kind) {
  switch (kind) {
    case v1::FILE_KIND_IMAGE:
      return FileKind::kImage;
    case v1::FILE_KIND_POSES:
      return FileKind::kPoses;
    case v1::FILE_KIND_MASK:
      return FileKind::kMask;
    case v1::FILE_KIND_IGNORE_MASK:
      return FileKind::kIgnoreMask;
    case v1::FILE_KIND_DEPTH:
      return FileKind::kDepth;
    case v1::FILE_KIND_DISPARITY:
      return FileKind::kDisparity;
    case v1::FILE_KIND_POINTS:
      return FileKind::kPoints;
    case v1::FILE_KIND_GAUSSIANS:
      return FileKind::kGaussians;
    case v1::FILE_KIND_VIDEO:
      return FileKind::kVideo;
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("kind: ", static_cast<int>(kind), " is not a kind of file"));
  }
}

google::protobuf::Timestamp ToProto(absl::Time time) {
  google::protobuf::Timestamp proto;
  const int64_t nanos = absl::ToUnixNanos(time);
  proto.set_seconds(nanos / 1'000'000'000);
  proto.set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
  return proto;
}

google::protobuf::Duration ToProto(absl::Duration duration) {
  google::protobuf::Duration proto;
  const int64_t nanos = absl::ToInt64Nanoseconds(duration);
  proto.set_seconds(nanos / 1'000'000'000);
  proto.set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
  return proto;
}

v1::Vector3 VectorToProto(const std::array<double, 3>& vector) {
  v1::Vector3 proto;
  proto.set_x(vector[0]);
  proto.set_y(vector[1]);
  proto.set_z(vector[2]);
  return proto;
}

v1::View ToProto(const ModelView& view) {
  v1::View proto;
  proto.set_view(view.name);
  v1::PinholeCamera& camera = *proto.mutable_camera();
  camera.set_width(view.camera.width);
  camera.set_height(view.camera.height);
  camera.set_fx(view.camera.fx);
  camera.set_fy(view.camera.fy);
  camera.set_cx(view.camera.cx);
  camera.set_cy(view.camera.cy);
  v1::RigidTransform& pose = *proto.mutable_cam_from_world();
  const Eigen::Quaterniond& q = view.cam_from_world.rotation;
  v1::Quaternion& rotation = *pose.mutable_rotation();
  rotation.set_w(q.w());
  rotation.set_x(q.x());
  rotation.set_y(q.y());
  rotation.set_z(q.z());
  const Eigen::Vector3d& t = view.cam_from_world.translation;
  *pose.mutable_translation() = VectorToProto({t.x(), t.y(), t.z()});
  proto.set_held_out(view.held_out);
  const auto& photograph = view.photograph;
  // A view without a photograph is the only frame of its pixels.
  proto.set_photograph_width(photograph ? photograph->UprightWidth() : view.camera.width);
  proto.set_photograph_height(photograph ? photograph->UprightHeight() : view.camera.height);
  if (view.scores) *proto.mutable_scores() = ToProto(*view.scores);
  return proto;
}

v1::ImageScores ToProto(const ImageScores& scores) {
  v1::ImageScores proto;
  proto.set_psnr(scores.psnr);
  proto.set_ssim(scores.ssim);
  if (scores.lpips) proto.set_lpips(*scores.lpips);
  return proto;
}

}  // namespace pepeseg
