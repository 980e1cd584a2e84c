// A library in place of ONNX Runtime, with the part of its C interface that core/onnx uses. Two of
// its "models" segment by colour: the encoder returns mean colours, the decoder the cells whose
// colour is similar to that of the first point, or of the middle of a box. A model with an input "rendering" returns the mean
// difference of its two inputs. One that contains "a detector" finds the red and the blue pixels:
// two words, a box each. A model file that contains "out of memory" is refused as the real library
// refuses one that does not fit, and one that contains "no network" as one that it cannot read; one
// that contains "endless" runs until it is asked to end.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

namespace {

constexpr int kCells = 64, kExtent = 256, kMasks = 4, kChannels = 256, kFrame = 1024;

struct Failure {
  std::string message;
};
struct Session {
  bool decodes = false, compares = false, endless = false, detects = false;
};
struct Value {
  std::vector<int64_t> shape;
  std::vector<float> owned;
  float* data = nullptr;
};

Value* MakeValue(std::vector<int64_t> shape) {
  size_t count = 1;
  for (const int64_t size : shape) count *= static_cast<size_t>(size);
  auto* value = new Value{std::move(shape), std::vector<float>(count), nullptr};
  value->data = value->owned.data();
  return value;
}

const char* GetErrorMessage(Failure* failure) { return failure->message.c_str(); }
Failure* MakeObject(void** out) {
  *out = new int(0);
  return nullptr;
}
Failure* CreateEnv(int, const char*, void** out) { return MakeObject(out); }
Failure* CreateCpuMemoryInfo(int, int, void** out) { return MakeObject(out); }
Failure* DisableMemPattern(void*) { return nullptr; }
Failure* SetIntraOpNumThreads(void*, int) { return nullptr; }
Failure* AddSessionConfigEntry(void*, const char*, const char*) { return nullptr; }
Failure* CreateSession(void*, const void* bytes, size_t size, void*, void** out) {
  const std::string_view model(static_cast<const char*>(bytes), size);
  if (model.find("out of memory") != model.npos) {
    return new Failure{"Failed to allocate memory for requested buffer of size 1"};
  }
  if (model.find("no network") != model.npos) return new Failure{"Protobuf parsing failed."};
  *out =
      new Session{model.find("point_coords") != model.npos, model.find("rendering") != model.npos,
                  model.find("endless") != model.npos, model.find("a detector") != model.npos};
  return nullptr;
}
Failure* CreateTensor(void*, void* data, size_t, const int64_t* shape, size_t rank, int,
                      void** out) {
  *out = new Value{std::vector<int64_t>(shape, shape + rank), {}, static_cast<float*>(data)};
  return nullptr;
}
Failure* GetData(Value* value, void** out) {
  *out = value->data;
  return nullptr;
}
Failure* GetShape(Value* value, void** out) {
  *out = new std::vector<int64_t>(value->shape);
  return nullptr;
}
Failure* GetDimensionsCount(std::vector<int64_t>* shape, size_t* out) {
  *out = shape->size();
  return nullptr;
}
Failure* GetDimensions(std::vector<int64_t>* shape, int64_t* out, size_t count) {
  std::copy_n(shape->begin(), count, out);
  return nullptr;
}

Value* Encode(const Value& image) {
  constexpr int kBlock = kFrame / kCells;
  Value* colours = MakeValue({1, kChannels, kCells, kCells});
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kFrame; ++y) {
      for (int x = 0; x < kFrame; ++x) {
        colours->data[(c * kCells + y / kBlock) * kCells + x / kBlock] +=
            image.data[(static_cast<size_t>(c) * kFrame + y) * kFrame + x] / (kBlock * kBlock);
      }
    }
  }
  return colours;
}

void Decode(const Value& colours, const Value& points, const Value& labels, Value& logits,
            Value& ious) {
  constexpr float kTolerance[kMasks] = {0.3F, 0.2F, 0.4F, 0.8F},
                  kIous[kMasks] = {0.9F, 0.95F, 0.9F, 0.85F};
  const int64_t num_points = points.shape[1];
  for (int64_t prompt = 0; prompt < points.shape[0]; ++prompt) {
    const float* point = points.data + prompt * num_points * 2;
    const auto cell = [](float at) {
      return std::clamp(static_cast<int>(at / kFrame * kCells), 0, kCells - 1);
    };
    const bool is_box = labels.data[prompt * num_points] == 2;  // its first corner
    const auto middle = [&](int axis) {
      return is_box ? (point[axis] + point[2 + axis]) / 2 : point[axis];
    };
    const int seed = cell(middle(1)) * kCells + cell(middle(0));
    std::array<float, kCells * kCells> distances{};
    for (int c = 0; c < 3; ++c) {
      const float* plane = colours.data + c * kCells * kCells;
      for (int i = 0; i < kCells * kCells; ++i) {
        distances[i] = std::max(distances[i], std::abs(plane[i] - plane[seed]));
      }
    }
    float* logit = logits.data + prompt * kMasks * kExtent * kExtent;
    for (const float tolerance : kTolerance) {
      for (int y = 0; y < kExtent; ++y) {
        const float* row = &distances[y * kCells / kExtent * kCells];
        for (int x = 0; x < kExtent; ++x) {
          *logit++ = row[x * kCells / kExtent] < tolerance ? 8.0F : -8.0F;
        }
      }
    }
    std::copy_n(kIous, kMasks, ious.data + prompt * kMasks);
  }
}

Value* Compare(const Value& a, const Value& b) {
  int64_t count = 1;
  for (const int64_t size : a.shape) count *= size;
  Value* difference = MakeValue({1, 1, 1, 1});
  for (int64_t i = 0; i < count; ++i) {
    difference->data[0] += std::abs(a.data[i] - b.data[i]) / static_cast<float>(count);
  }
  return difference;
}

// Scores and sides of the core/priors/detect network.
void Detect(const Value& image, Value& scores, Value& sides) {
  constexpr int kSide = 512, kGrid = 128, kWords = 2;
  for (int word = 0; word < kWords; ++word) {
    int x0 = kSide, y0 = kSide, x1 = 0, y1 = 0;
    for (int i = 0; i < kSide * kSide; ++i) {
      const float* pixel = image.data + size_t{3} * i;
      if (pixel[2 * word] < 150 || pixel[2 - 2 * word] > 100) continue;
      x0 = std::min(x0, i % kSide);
      y0 = std::min(y0, i / kSide);
      x1 = std::max(x1, i % kSide + 1);
      y1 = std::max(y1, i / kSide + 1);
    }
    if (x1 == 0) continue;
    const int x = (x0 + x1) / 2 * kGrid / kSide, y = (y0 + y1) / 2 * kGrid / kSide;
    scores.data[(y * kGrid + x) * kWords + word] = word == 0 ? 0.8F : 0.4F;
    const int stride = kSide / kGrid;
    const int distances[] = {x * stride - x0, y * stride - y0, x1 - x * stride, y1 - y * stride};
    std::copy_n(distances, 4, sides.data + (y * kGrid + x) * 4);
  }
}

Failure* CreateRunOptions(std::atomic<bool>** out) {
  *out = new std::atomic<bool>(false);
  return nullptr;
}
Failure* SetTerminate(std::atomic<bool>* terminate) {
  *terminate = true;
  terminate->notify_all();
  return nullptr;
}
Failure* Run(Session* session, std::atomic<bool>* terminate, const char* const*,
             Value* const* inputs, size_t, const char* const*, size_t, void** outputs) {
  if (session->endless) terminate->wait(false);
  if (*terminate) return new Failure{"Exiting due to terminate flag being set to true."};
  if (session->compares) {
    outputs[0] = Compare(*inputs[0], *inputs[1]);
    return nullptr;
  }
  if (session->detects) {
    Value *scores = MakeValue({1, 128, 128, 2}), *sides = MakeValue({1, 128, 128, 4});
    Detect(*inputs[0], *scores, *sides);
    outputs[0] = scores;
    outputs[1] = sides;
    return nullptr;
  }
  if (!session->decodes) {
    outputs[0] = Encode(*inputs[0]);
    return nullptr;
  }
  const int64_t num_prompts = inputs[1]->shape[0];
  Value* logits = MakeValue({num_prompts, kMasks, kExtent, kExtent});
  Value* ious = MakeValue({num_prompts, kMasks});
  Decode(*inputs[0], *inputs[1], *inputs[2], *logits, *ious);
  outputs[0] = logits;
  outputs[1] = ious;
  return nullptr;
}

template <typename T>
void Release(T* object) {
  delete object;
}

using Function = void (*)();
const Function* GetApi(uint32_t version) {
  static Function table[250] = {};
  const auto set = [](int position, auto* function) {
    table[position] = reinterpret_cast<Function>(function);
  };
  set(2, GetErrorMessage);
  set(3, CreateEnv);
  set(8, CreateSession);
  set(9, Run);
  set(10, MakeObject);
  set(17, DisableMemPattern);
  set(24, SetIntraOpNumThreads);
  set(39, CreateRunOptions);
  set(46, SetTerminate);
  set(49, CreateTensor);
  set(51, GetData);
  set(61, GetDimensionsCount);
  set(62, GetDimensions);
  set(65, GetShape);
  set(69, CreateCpuMemoryInfo);
  for (const int position : {92, 94, 100}) set(position, Release<int>);
  set(93, Release<Failure>);
  set(95, Release<Session>);
  set(96, Release<Value>);
  set(97, Release<std::atomic<bool>>);
  set(99, Release<std::vector<int64_t>>);
  set(130, AddSessionConfigEntry);
  return version <= 17 ? table : nullptr;
}

const char* GetVersion() { return "1.17.0"; }

struct ApiBase {
  const Function* (*get_api)(uint32_t version);
  const char* (*get_version)();
};

}  // namespace

extern "C" __attribute__((visibility("default"))) const ApiBase* OrtGetApiBase() {
  static const ApiBase base = {GetApi, GetVersion};
  return &base;
}
