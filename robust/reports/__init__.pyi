from .page import write_report as write_report
from .shaping_page.page import write_shaping_page as write_shaping_page
from .shaping_page.widget import shape as shape
