"""Planning and driving on a model."""
