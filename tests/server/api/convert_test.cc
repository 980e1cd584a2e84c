#include "server/api/convert.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/train/settings/training_settings.h"
#include "server/api/request_image.h"
#include "server/store/error_detail.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Returns "import.image_scale", ... for all fields of the message.
std::set<std::string> FieldNames() {
  std::set<std::string> names;
  const auto* type = v1::TrainingOptions::descriptor();
  for (int i = 0; i < type->field_count(); ++i) {
    const auto* part = type->field(i)->message_type();
    if (part == nullptr || type->field(i)->is_repeated()) continue;
    for (int k = 0; k < part->field_count(); ++k) {
      names.insert(type->field(i)->name() + "." + part->field(k)->name());
    }
  }
  return names;
}

// Returns all options as "NAME=VALUE".
std::vector<std::string> Lines(const TrainingSettings& settings) {
  std::vector<std::string> lines;
  for (const OptionText& option : ListOptions(settings)) {
    lines.push_back(option.name + "=" + option.value);
  }
  return lines;
}

// Returns settings in which no option has its default.
TrainingSettings Changed() {
  TrainingSettings settings;
  VisitOptions(settings, [](const Option& option) {
    if (const auto* field = std::get_if<WordField>(&option.field)) {
      const auto& words = field->words;
      EXPECT_OK(SetOption(option, TextOf(option).value == words[1].first
                                      ? words[2 % words.size()].first
                                      : words[1].first));
    } else if (const auto* on = std::get_if<bool*>(&option.field)) {
      **on = !**on;
    } else if (std::get_if<NamesField>(&option.field) != nullptr) {
      EXPECT_OK(SetOption(option, "a, b.jpg"));
      EXPECT_OK(SetOption(option, "c.jpg"));
    } else if (std::get_if<uint64_t*>(&option.field) != nullptr) {
      EXPECT_OK(SetOption(option, "18446744073709551615"));
    } else {
      const std::string high = absl::StrCat(option.range.high);
      const std::string before = TextOf(option).value;
      for (const std::string& text :
           {std::string("0.3"), std::string("3"), std::string("2"), high}) {
        if (SetOption(option, text).ok() && TextOf(option).value != before) break;
      }
      EXPECT_NE(TextOf(option).value, before) << option.name;
    }
  });
  return settings;
}

TEST(TrainingOptions, HaveAnOptionForEachField) {
  std::set<std::string> options;
  for (const OptionText& option : ListOptions(TrainingSettings())) options.insert(option.name);
  for (const std::string& field : FieldNames()) EXPECT_TRUE(options.contains(field)) << field;
  EXPECT_LE(FieldNames().size(), 25u);
}

TEST(TrainingOptions, ConvertEveryOptionToTheMessageAndBack) {
  const TrainingSettings settings = Changed();
  const v1::TrainingOptions proto = ToProto(settings);
  EXPECT_EQ(proto.advanced_size() + FieldNames().size(), ListOptions(settings).size());
  EXPECT_EQ(proto.features().seed(), ~uint64_t{0});
  EXPECT_EQ(proto.import().held_out_views_size(), 2);
  ASSERT_OK_AND_ASSIGN(const TrainingSettings read, TrainingSettingsFromProto(proto));
  EXPECT_EQ(Lines(read), Lines(settings));
}

TEST(TrainingOptions, KeepDefaultsOfAbsentFields) {
  ASSERT_OK_AND_ASSIGN(const TrainingSettings settings, TrainingSettingsFromProto({}));
  EXPECT_EQ(Lines(settings), Lines(TrainingSettings()));
  const v1::TrainingOptions effective = ToProto(settings);
  EXPECT_EQ(effective.reconstruct().num_steps(), ReconstructOptions().num_steps);
  EXPECT_EQ(effective.import().held_out_every(), ImportOptions().held_out_every);
  EXPECT_EQ(effective.advanced().at("features.smooth_until"), "0.5");
  EXPECT_TRUE(effective.sfm().has_matching());
  EXPECT_EQ(effective.sfm().matching(), v1::SFM_MATCHING_UNSPECIFIED);
}

TEST(TrainingOptions, TakeEveryValueOfTheEnums) {
  v1::TrainingOptions options;
  for (int i = 1; i < v1::SfmEngine_ARRAYSIZE; ++i) {
    options.mutable_sfm()->set_front(static_cast<v1::SfmEngine>(i));
    ASSERT_OK_AND_ASSIGN(const auto settings, TrainingSettingsFromProto(options));
    EXPECT_EQ(static_cast<int>(settings.sfm.front), i);
  }
  for (int i = 1; i < v1::SfmMatching_ARRAYSIZE; ++i) {
    options.mutable_sfm()->set_matching(static_cast<v1::SfmMatching>(i));
    ASSERT_OK_AND_ASSIGN(const auto settings, TrainingSettingsFromProto(options));
    EXPECT_EQ(static_cast<int>(settings.sfm.matching), i);
  }
  for (int i = 1; i < v1::PriorMaker_ARRAYSIZE; ++i) {
    options.mutable_priors()->set_masks(static_cast<v1::PriorMaker>(i));
    ASSERT_OK_AND_ASSIGN(const auto settings, TrainingSettingsFromProto(options));
    EXPECT_EQ(static_cast<int>(settings.priors.masks), i);
  }
}

TEST(TrainingOptions, SetAdvancedOptionsLast) {
  v1::TrainingOptions options;
  options.set_preset(v1::TRAINING_PRESET_BEST);
  options.mutable_features()->set_num_steps(7);
  (*options.mutable_advanced())["features.num_steps"] = "8";
  (*options.mutable_advanced())["features.smooth_until"] = "0.25";
  ASSERT_OK_AND_ASSIGN(const auto settings, TrainingSettingsFromProto(options));
  EXPECT_EQ(settings.features.num_steps, 8);
  EXPECT_EQ(settings.features.smooth_until, 0.25);
  EXPECT_EQ(settings.reconstruct.dropout, 0.2f);
}

TEST(TrainingOptions, RefuseAdvancedOptionsByNameAndRange) {
  const auto refused = [](const char* name, const char* text) {
    v1::TrainingOptions options;
    (*options.mutable_advanced())[name] = text;
    const absl::Status status = TrainingSettingsFromProto(options).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    return std::string(status.message());
  };
  EXPECT_EQ(refused("features.smoth_until", "0"),
            "options.advanced: unknown option \"features.smoth_until\"; did you mean "
            "features.smooth_until?");
  EXPECT_EQ(refused("features.smooth_until", "2"),
            "options.advanced: features.smooth_until is \"2\", must be in [0, 1]");
  EXPECT_EQ(refused("features.num_drawn_neighbors", "5"),
            "options.features.num_drawn_neighbors is 5, must be in [1, 4]");
  EXPECT_EQ(refused("features.smooth_until", std::string(2000, '0').c_str()),
            "options.advanced: features.smooth_until: 2000 bytes exceed the limit of 1024");
  EXPECT_NE(refused("preset", "best").find("unknown option"), std::string::npos);
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

// Returns the options of one stage, "reconstruct." or "features.", by name.
std::map<std::string, std::string> OptionsOf(const std::string& stage,
                                             const TrainingSettings& settings) {
  std::map<std::string, std::string> options;
  for (const OptionText& option : ListOptions(settings)) {
    if (absl::StartsWith(option.name, stage))
      options[option.name.substr(stage.size())] = option.value;
  }
  return options;
}

// A new option must be decided on for the preset "paper": it differs from the default there, or it
// is listed here, because the recipe has the default's value or nothing to do with it.
TEST(TrainingOptions, DecidesEveryOptionForThePaper) {
  v1::TrainingOptions options;
  options.set_preset(v1::TRAINING_PRESET_PAPER);
  const TrainingSettings paper = *TrainingSettingsFromProto(options);
  const auto check = [&](const std::string& stage, std::set<std::string> decided) {
    const auto of_standard = OptionsOf(stage, TrainingSettings());
    for (const auto& [name, value] : OptionsOf(stage, paper)) {
      if (of_standard.at(name) != value) {
        EXPECT_TRUE(decided.insert(name).second) << name << " is listed, but differs";
      }
      EXPECT_TRUE(decided.contains(name)) << "training_settings.cc does not decide on " << name;
    }
  };
  check("reconstruct.",
        {"sh_degree", "ssim_weight", "mean_learning_rate", "log_scale_learning_rate",
         "rotation_learning_rate", "opacity_learning_rate", "sh_learning_rate",
         "second_moment_decay", "densify_from", "densify_every", "densify_gradient", "densify_size",
         "prune_opacity", "prune_size", "opacity_reset_every", "depth_local_form", "depth_window",
         "refine_from", "refine_candidates", "coarse_until",
         // Without effect in the preset.
         "opacity_decay", "closing_share", "dropout_until", "full_size_visits", "few_visits_steps",
         // Options of the run, the device or the capture.
         "num_random_points", "seed", "photographs_on_host", "capture_kind"});
  check("features.", {"num_steps", "num_pixels", "num_scales", "centroid_from", "centroid_every",
                      "centroid_pixels", "centroid_cosine_upper", "centroid_merge_upper",
                      "perception_weight", "perception_unlabelled_only", "min_mask_agreement",
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
    if (field->is_repeated()) continue;
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
  EXPECT_EQ(UnspecifyEveryEnum(&options), 7);
  const auto unspecified = TrainingSettingsFromProto(options);
  const auto absent = TrainingSettingsFromProto({});
  ASSERT_OK(unspecified);
  ASSERT_OK(absent);
  EXPECT_EQ(ToProto(*unspecified).DebugString(), ToProto(*absent).DebugString());
}

TEST(TrainingOptions, KeepsAZeroThatIsNoEnum) {
  v1::TrainingOptions options;
  options.mutable_import()->set_held_out_every(0);
  EXPECT_EQ(TrainingSettingsFromProto(options)->import.held_out_every, 0);
  ASSERT_NE(ImportOptions().held_out_every, 0) << "the test needs another default";
}

TEST(TrainingOptions, NamesTheFieldThatIsOutOfRange) {
  v1::TrainingOptions options;
  options.mutable_import()->set_image_scale(1.5);
  EXPECT_STATUS(TrainingSettingsFromProto(options), absl::StatusCode::kInvalidArgument,
                "options.import.image_scale is \"1.5\", must be in (0, 1]");
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
  EXPECT_EQ(refused.message().find("options.priors.masks is \"6\", must be auto, none"), 0u)
      << refused;
}

TEST(TrainingOptions, RefusesSamAsAMakerOfDepth) {
  v1::TrainingOptions options;
  options.mutable_priors()->set_depth(v1::PRIOR_MAKER_SAM);
  const auto refused = TrainingSettingsFromProto(options).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
  EXPECT_EQ(refused.message(),
            "options.priors.depth is \"sam\", must be auto, none, embedded or command");
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
