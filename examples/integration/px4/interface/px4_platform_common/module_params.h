#pragma once
namespace px4 {
enum class params { GHK_MASS, GHK_RPM_FULL, COUNT };
inline float& param_value(params which) {
    static float values[static_cast<int>(params::COUNT)] = {0.7f, 17189.0f}; /* as in module.yaml */
    return values[static_cast<int>(which)];
}
}  // namespace px4

template <px4::params P>
class ParamFloat {
  public:
    float get() const { return px4::param_value(P); }
};

class ModuleParams {
  public:
    explicit ModuleParams(ModuleParams*) {}
    virtual ~ModuleParams() = default;

  protected:
    void updateParams() {}
};

/* "(ParamFloat<...>) _name" to a member, for the two of this module. */
#define INTERFACE_WITHOUT_PARENTHESES(...) __VA_ARGS__
#define DEFINE_PARAMETERS(first, second)   \
    INTERFACE_WITHOUT_PARENTHESES first{}; \
    INTERFACE_WITHOUT_PARENTHESES second{};
