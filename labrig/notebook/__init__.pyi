from .views import (
    html as html,
    plot as plot,
)
