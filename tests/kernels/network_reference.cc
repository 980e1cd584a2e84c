#include "tests/kernels/network_reference.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

double Activated(Activation activation, double x) {
  if (activation == Activation::kRelu) return std::max(x, 0.0);
  if (activation == Activation::kGelu) return x / 2 * (1 + std::erf(x / std::sqrt(2.0)));
  return x;
}

std::vector<double> Normalized(std::vector<double> row, double epsilon) {
  double mean = 0, variance = 0;
  for (const double x : row) mean += x / static_cast<double>(row.size());
  for (const double x : row) variance += (x - mean) * (x - mean) / static_cast<double>(row.size());
  for (double& x : row) x = (x - mean) / std::sqrt(variance + epsilon);
  return row;
}

// Returns a value of an image, or 0 outside.
double At(const std::vector<float>& values, int image, int y, int x, int c, int height, int width,
          int channels) {
  if (y < 0 || y >= height || x < 0 || x >= width) return 0;
  return static_cast<double>(values[((int64_t{image} * height + y) * width + x) * channels + c]);
}

// Calls f(token, place) for each token of a grid, with place -1 for padding.
template <class F>
void ForEachToken(const WindowGrid& grid, const F& f) {
  int64_t token = 0;
  for (int image = 0; image < grid.num_images; ++image) {
    for (int top = 0; top < grid.height; top += grid.side) {
      for (int left = 0; left < grid.width; left += grid.side) {
        for (int y = top; y < top + grid.side; ++y) {
          for (int x = left; x < left + grid.side; ++x) {
            const bool inside = y < grid.height && x < grid.width;
            f(token++, inside ? (int64_t{image} * grid.height + y) * grid.width + x : -1);
          }
        }
      }
    }
  }
}

}  // namespace

std::vector<double> LinearReference(const LinearArgs& args, const LinearValues& values) {
  std::vector<int64_t> places(args.rows);
  for (int64_t r = 0; r < args.rows; ++r) places[r] = r;
  if (args.gather || args.scatter) {
    ForEachToken(args.windows, [&](int64_t token, int64_t place) { places[token] = place; });
  }
  std::vector<double> output((args.scatter ? args.windows.num_places() : args.rows) * args.out);
  for (int64_t r = 0; r < args.rows; ++r) {
    const int64_t from = args.gather ? places[r] : r, to = args.scatter ? places[r] : r;
    if (to < 0) continue;
    std::vector<double> row(args.in);
    for (int k = 0; k < args.in && from >= 0; ++k) {
      row[k] = static_cast<double>(values.input[from * args.in + k]);
    }
    if (args.normalize) row = Normalized(row, static_cast<double>(args.epsilon));
    for (int c = 0; c < args.out; ++c) {
      double sum = values.bias.empty() ? 0 : static_cast<double>(values.bias[c]);
      for (int k = 0; k < args.in; ++k) {
        sum += row[k] * static_cast<double>(values.weights[int64_t{k} * args.out + c]);
      }
      const int64_t at = to * args.out + c;
      if (!values.residual.empty()) sum += static_cast<double>(values.residual[at]);
      output[at] = Activated(args.activation, sum);
    }
  }
  return output;
}

std::vector<double> LayerNormReference(const LayerNormArgs& args, const std::vector<float>& input,
                                       const std::vector<float>& scale,
                                       const std::vector<float>& shift) {
  std::vector<double> output;
  for (int64_t r = 0; r < args.rows; ++r) {
    const auto first = input.begin() + r * args.channels;
    const std::vector<double> row =
        Normalized({first, first + args.channels}, static_cast<double>(args.epsilon));
    for (int c = 0; c < args.channels; ++c) {
      output.push_back(row[c] * static_cast<double>(scale[c]) + static_cast<double>(shift[c]));
    }
  }
  return output;
}

std::vector<double> ConvolveReference(const Convolve3x3Args& args, const std::vector<float>& input,
                                      const std::vector<float>& weights,
                                      const std::vector<float>& bias) {
  std::vector<double> output;
  for (int image = 0; image < args.num_images; ++image) {
    for (int y = 0; y < args.height; y += args.stride) {
      for (int x = 0; x < args.width; x += args.stride) {
        for (int to = 0; to < args.out; ++to) {
          double sum = bias.empty() ? 0 : static_cast<double>(bias[to]);
          for (int tap = 0; tap < 9; ++tap) {
            for (int c = 0; c < args.in; ++c) {
              const double weight =
                  static_cast<double>(weights[(int64_t{tap} * args.in + c) * args.out + to]);
              sum += weight * At(input, image, y + tap / 3 - 1, x + tap % 3 - 1, c, args.height,
                                 args.width, args.in);
            }
          }
          output.push_back(Activated(args.activation, sum));
        }
      }
    }
  }
  return output;
}

std::vector<double> DepthwiseReference(const DepthwiseConvolveArgs& args,
                                       const std::vector<float>& input,
                                       const std::vector<float>& weights,
                                       const std::vector<float>& bias) {
  std::vector<double> output;
  for (int image = 0; image < args.num_images; ++image) {
    for (int y = 0; y < args.height; y += args.stride) {
      for (int x = 0; x < args.width; x += args.stride) {
        for (int c = 0; c < args.channels; ++c) {
          auto sum = static_cast<double>(bias[c]);
          for (int tap = 0; tap < 9; ++tap) {
            sum += static_cast<double>(weights[tap * args.channels + c]) *
                   At(input, image, y + tap / 3 - 1, x + tap % 3 - 1, c, args.height, args.width,
                      args.channels);
          }
          output.push_back(Activated(args.activation, sum));
        }
      }
    }
  }
  return output;
}

std::vector<double> AttentionReference(const WindowAttentionArgs& args,
                                       const std::vector<float>& qkv,
                                       const std::vector<float>& bias) {
  const auto at = [&](int64_t window, int token, int head, int part, int c) {
    const int64_t row = (window * args.tokens + token) * args.heads + head;
    return static_cast<double>(qkv[(row * 3 + part) * kHeadSize + c]);
  };
  std::vector<double> output(args.num_windows * args.tokens * args.heads * kHeadSize);
  for (int64_t window = 0; window < args.num_windows; ++window) {
    for (int head = 0; head < args.heads; ++head) {
      for (int query = 0; query < args.tokens; ++query) {
        std::vector<double> scores(args.tokens);
        double total = 0;
        for (int key = 0; key < args.tokens; ++key) {
          double sum = 0;
          for (int c = 0; c < kHeadSize; ++c) {
            sum += at(window, query, head, 0, c) * at(window, key, head, 1, c);
          }
          const int64_t row = int64_t{head} * args.tokens + query;
          const auto offset = static_cast<double>(bias[row * args.bias_stride + key]);
          scores[key] = std::exp(sum / std::sqrt(double{kHeadSize}) + offset);
          total += scores[key];
        }
        const int64_t row = (window * args.tokens + query) * args.heads + head;
        for (int c = 0; c < kHeadSize; ++c) {
          for (int key = 0; key < args.tokens; ++key) {
            output[row * kHeadSize + c] += scores[key] / total * at(window, key, head, 2, c);
          }
        }
      }
    }
  }
  return output;
}

}  // namespace pepeseg
