#include "server/api/convert.h"

#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "server/api/request_image.h"
#include "server/store/error_detail.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Sets each number of the message, and of messages in it, to a value that is not the default.
void SetEveryField(Message* message, int* next) {
  const auto* reflection = message->GetReflection();
  for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = message->GetDescriptor()->field(i);
    const int value = (*next)++;
    if (field->is_repeated()) {  // only lists of text
      reflection->AddString(message, field, std::to_string(value));
      continue;
    }
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_MESSAGE:
        SetEveryField(reflection->MutableMessage(message, field), next);
        break;
      case FieldDescriptor::CPPTYPE_INT32:
        reflection->SetInt32(message, field, value);
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        reflection->SetInt64(message, field, value);
        break;
      case FieldDescriptor::CPPTYPE_UINT64:
        reflection->SetUInt64(message, field, static_cast<uint64_t>(value));
        break;
      case FieldDescriptor::CPPTYPE_FLOAT:
        reflection->SetFloat(message, field, static_cast<float>(value));
        break;
      case FieldDescriptor::CPPTYPE_DOUBLE:
        reflection->SetDouble(message, field, value);
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        reflection->SetBool(message, field, false);  // by default they are true
        break;
      case FieldDescriptor::CPPTYPE_ENUM:  // which keeps numbers that it does not know
        reflection->SetEnumValue(message, field, value);
        break;
      default:
        FAIL() << field->full_name() << " has a type that this test does not know";
    }
  }
}

void CheckEveryFieldPresent(const Message& message) {
  const auto* reflection = message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = message.GetDescriptor()->field(i);
    if (field->is_repeated()) continue;  // empty by default
    EXPECT_TRUE(reflection->HasField(message, field)) << field->full_name();
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      CheckEveryFieldPresent(reflection->GetMessage(message, field));
    }
  }
}

TEST(TrainingOptions, ConvertsEveryFieldToSettingsAndBack) {
  v1::TrainingOptions wanted;
  int next = 100'001;  // no default's value
  SetEveryField(&wanted, &next);
  ASSERT_GT(next, 100'027) << "there are more options than this";
  TrainingSettings settings;
  Overlay(wanted, &settings);
  EXPECT_EQ(ToProto(settings).DebugString(), wanted.DebugString());
}

TEST(TrainingOptions, KeepsDefaultsOfAbsentFields) {
  TrainingSettings settings;
  Overlay(v1::TrainingOptions(), &settings);
  const v1::TrainingOptions effective = ToProto(settings);
  CheckEveryFieldPresent(effective);
  EXPECT_EQ(effective.reconstruct().num_steps(), ReconstructOptions().num_steps);
  EXPECT_EQ(effective.features().learning_rate(), FeatureOptions().learning_rate);
  EXPECT_EQ(effective.import().held_out_every(), ImportOptions().held_out_every);
}

TEST(TrainingOptions, FillsAbsentFieldsFromThePreset) {
  v1::TrainingOptions options;
  options.set_preset(v1::TRAINING_PRESET_PREVIEW);
  options.mutable_features()->set_num_steps(77);
  ASSERT_OK_AND_ASSIGN(const auto preview, TrainingSettingsFromProto(options));
  EXPECT_LT(preview.reconstruct.num_steps, ReconstructOptions().num_steps);
  EXPECT_EQ(preview.features.num_steps, 77);
  EXPECT_EQ(preview.features.num_scales, FeatureOptions().num_scales);
  EXPECT_EQ(ToProto(preview).preset(), v1::TRAINING_PRESET_PREVIEW);
  // Effective options convert to themselves.
  ASSERT_OK_AND_ASSIGN(const auto again, TrainingSettingsFromProto(ToProto(preview)));
  EXPECT_EQ(ToProto(again).DebugString(), ToProto(preview).DebugString());

  options.set_preset(v1::TRAINING_PRESET_BEST);
  ASSERT_OK_AND_ASSIGN(const auto best, TrainingSettingsFromProto(options));
  EXPECT_GT(best.reconstruct.num_steps, ReconstructOptions().num_steps);
}

// Lists the names of the fields in which two messages differ.
std::set<std::string> DifferingFields(const Message& one, const Message& other) {
  std::set<std::string> names;
  for (int i = 0; i < one.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = one.GetDescriptor()->field(i);
    std::string a, b;
    google::protobuf::TextFormat::PrintFieldValueToString(one, field, -1, &a);
    google::protobuf::TextFormat::PrintFieldValueToString(other, field, -1, &b);
    if (a != b) names.insert(field->name());
  }
  return names;
}

// A new option must be decided on for the preset "paper": it differs from the default there, or it
// is listed here, because the recipe has the default's value or nothing to do with it.
TEST(TrainingOptions, DecidesEveryOptionForThePaper) {
  v1::TrainingOptions options;
  options.set_preset(v1::TRAINING_PRESET_PAPER);
  const v1::TrainingOptions paper = ToProto(*TrainingSettingsFromProto(options));
  const v1::TrainingOptions standard = ToProto(*TrainingSettingsFromProto({}));
  const auto check = [](const Message& of_paper, const Message& of_standard,
                        std::set<std::string> decided) {
    for (const std::string& name : DifferingFields(of_paper, of_standard)) {
      EXPECT_TRUE(decided.insert(name).second) << name << " is listed, but differs";
    }
    for (int i = 0; i < of_paper.GetDescriptor()->field_count(); ++i) {
      const std::string& name = of_paper.GetDescriptor()->field(i)->name();
      EXPECT_TRUE(decided.contains(name)) << "training_settings.cc does not decide on " << name;
    }
  };
  check(paper.reconstruct(), standard.reconstruct(),
        {"sh_degree", "ssim_weight", "mean_learning_rate", "log_scale_learning_rate",
         "rotation_learning_rate", "opacity_learning_rate", "sh_learning_rate", "densify_from",
         "densify_every", "densify_gradient", "densify_size", "prune_opacity", "prune_size",
         "opacity_reset_every", "depth_local_form", "depth_window", "refine_from",
         "refine_candidates", "coarse_until", "max_megapixels",
         // Without effect in the preset.
         "opacity_decay", "closing_share", "dropout_until",
         // Of the run or the capture.
         "num_random_points", "seed", "capture_kind"});
  check(paper.features(), standard.features(),
        {"num_steps", "num_pixels", "num_scales", "centroid_from", "centroid_every",
         "centroid_pixels", "centroid_cosine_upper", "centroid_merge_upper", "perception_weight",
         "perception_unlabelled_only", "min_mask_agreement",
         // Not printed.
         "num_perception_pixels",
         // Without effect in the preset, or on the result.
         "closing_share", "steps_per_chunk",
         // The values of the run.
         "seed"});
}

TEST(TrainingOptions, EqualsTheDefaultsForStandard) {
  v1::TrainingOptions options;
  options.set_preset(v1::TRAINING_PRESET_STANDARD);
  const auto standard = TrainingSettingsFromProto(options);
  const auto absent = TrainingSettingsFromProto({});
  ASSERT_OK(standard);
  ASSERT_OK(absent);
  EXPECT_EQ(ToProto(*standard).DebugString(), ToProto(*absent).DebugString());
}

TEST(TrainingOptions, RefusesAnInvalidPreset) {
  v1::TrainingOptions options;
  options.set_preset(static_cast<v1::TrainingPreset>(5));
  EXPECT_STATUS(TrainingSettingsFromProto(options), absl::StatusCode::kInvalidArgument,
                "preset is");
}

// Sets each enum of the message, and of messages in it, to its value 0. Returns their number.
int UnspecifyEveryEnum(Message* message) {
  const auto* reflection = message->GetReflection();
  int count = 0;
  for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = message->GetDescriptor()->field(i);
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      count += UnspecifyEveryEnum(reflection->MutableMessage(message, field));
    } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_ENUM) {
      reflection->SetEnumValue(message, field, 0);
      ++count;
    }
  }
  return count;
}

TEST(TrainingOptions, TakesUnspecifiedEnumsAsAbsent) {
  v1::TrainingOptions options;
  EXPECT_GE(UnspecifyEveryEnum(&options), 8);
  const auto unspecified = TrainingSettingsFromProto(options);
  const auto absent = TrainingSettingsFromProto({});
  ASSERT_OK(unspecified);
  ASSERT_OK(absent);
  EXPECT_EQ(ToProto(*unspecified).DebugString(), ToProto(*absent).DebugString());
}

TEST(TrainingOptions, KeepsAZeroThatIsNoEnum) {
  v1::TrainingOptions options;
  options.mutable_reconstruct()->set_depth_local_weight(0);
  TrainingSettings settings;
  Overlay(options, &settings);
  EXPECT_EQ(settings.reconstruct.depth_local_weight, 0);
  ASSERT_NE(ReconstructOptions().depth_local_weight, 0) << "the test needs another default";
}

TEST(TrainingOptions, NamesTheFieldThatIsOutOfRange) {
  v1::TrainingOptions options;
  options.mutable_import()->set_image_scale(1.5);
  EXPECT_STATUS(TrainingSettingsFromProto(options), absl::StatusCode::kInvalidArgument,
                "image_scale");
}

TEST(TrainingOptions, RefusesAnInvalidMakerOfPriors) {
  v1::TrainingOptions options;
  options.mutable_priors()->set_depth(v1::PRIOR_MAKER_COMMAND);
  ASSERT_OK_AND_ASSIGN(const auto good, TrainingSettingsFromProto(options));
  EXPECT_EQ(good.priors.depth, PriorMaker::kCommand);
  EXPECT_EQ(good.priors.masks, PriorMaker::kAuto);
  options.mutable_priors()->set_masks(v1::PRIOR_MAKER_SAM_AND_EMBEDDED);
  EXPECT_EQ(TrainingSettingsFromProto(options)->priors.masks, PriorMaker::kSamAndEmbedded);
  options.mutable_priors()->set_masks(static_cast<v1::PriorMaker>(6));
  const auto refused = TrainingSettingsFromProto(options).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
  EXPECT_EQ(refused.message().find("options.priors: masks is 6"), 0u) << refused;
}

TEST(TrainingOptions, RefusesSamAsAMakerOfDepth) {
  v1::TrainingOptions options;
  options.mutable_priors()->set_depth(v1::PRIOR_MAKER_SAM);
  const auto refused = TrainingSettingsFromProto(options).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
  EXPECT_EQ(refused.message(),
            "options.priors: depth is 4, must be auto, none, embedded or command");
}

TEST(SimilarityMap, IsLittleEndianInt16) {
  const std::vector<float> similarity = {1.0f, -1.0f, 0.0f, 0.5f};
  const auto map = SimilarityToProto(2, 2, similarity);
  ASSERT_EQ(map.values().size(), 8u);
  const auto value = [&](size_t i) {
    return static_cast<int16_t>(static_cast<uint8_t>(map.values()[2 * i]) |
                                static_cast<uint8_t>(map.values()[2 * i + 1]) << 8);
  };
  EXPECT_EQ(value(0), 32767);
  EXPECT_EQ(value(1), -32767);
  EXPECT_EQ(value(2), 0);
  EXPECT_NEAR(value(3), 16384, 1);
}

TEST(FileKinds, AreDistinctAndOthersRefused) {
  std::set<FileKind> kinds;
  for (int kind = 1; kind < v1::FileKind_ARRAYSIZE; ++kind) {
    const auto read = FileKindFromProto(static_cast<v1::FileKind>(kind));
    ASSERT_OK(read) << kind;
    kinds.insert(*read);
  }
  EXPECT_EQ(kinds.size(), size_t{v1::FileKind_ARRAYSIZE} - 1);
  EXPECT_FALSE(FileKindFromProto(v1::FILE_KIND_UNSPECIFIED).ok());
  EXPECT_FALSE(FileKindFromProto(static_cast<v1::FileKind>(77)).ok());
}

}  // namespace
}  // namespace pepeseg
