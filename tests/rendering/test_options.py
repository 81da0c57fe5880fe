import pytest

from texbake import OptionError, RenderOptions


def test_the_defaults_are_valid_and_distance_is_to_be_found():
    assert RenderOptions().distance is None
    assert RenderOptions(view=(1.0, 2.0, None)).distance is None
    assert RenderOptions(view=(1.0, 2.0, 3.0)).distance == 3.0


@pytest.mark.parametrize("wrong", [
    {"width": 16384, "height": 16384, "supersampling": 2},
    {"view": (0.0, 0.0, 0.0)},
    {"background": (0.0, 0.0, 1.1)},
])  # fmt: skip
def test_a_wrong_option_is_named(wrong):
    with pytest.raises(OptionError) as caught:
        RenderOptions(**wrong)
    message = str(caught.value)
    assert message.split(":")[0] in wrong and "\n" not in message
